"""The paper's own figures, run: everything as in `configs/scale/paper.yaml` but the budget."""

import json
import math
from pathlib import Path

import pandas as pd
import pytest
import yaml
from recipe_runs import run

from tstar_rl.chaining.skill import Skill
from tstar_rl.config.load import CONFIGS

STEPS = 16 * 32  # of one rollout, by the paper's 16 simulations
BUDGET = [
    "demonstrations.episodes=8",
    "demonstrations.num_envs=8",
    "training.horizon=32",
    "training.total_steps=1024",
    "training.checkpoint_every=1024",
    "chain.rounds=1",
    f"chain.steps_per_turn={STEPS}",
    "chain.trial_episodes=8",
    "chain.trial_every=4",
]
SMALLER = {"horizon", "total_steps", "checkpoint_every", "episodes", "num_envs"}


def make(folder: Path, recipe: str, *values: str) -> None:
    where = [f"{place}_dir={folder / place}" for place in ("results", "runs", "demonstrations")]
    done = run(recipe, "scale=paper", "progress_bar=false", *BUDGET, *where, *values, small=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.timeout(1800)  # eight processes: minutes on a machine that does other things
def test_the_paper_scale_trains_skills_and_a_chain(tmp_path):
    make(tmp_path, "make_demonstrations", "kinds=[plain]")
    for subtask in range(4):
        make(tmp_path, "gail_ppo", f"subtask={subtask}")
    make(tmp_path, "tstar")
    make(tmp_path, "hand_over", "systems=[tstar]", "evaluation.episodes=4")
    check_skill(tmp_path)
    check_chain(tmp_path)


def check_skill(folder: Path) -> None:
    place = "table_lack/gail_ppo/seed0/subtask1"
    kept = yaml.safe_load((folder / "results" / place / "config.yaml").read_text())
    paper = yaml.safe_load((CONFIGS / "scale" / "paper.yaml").read_text())
    for section in ("env", "networks", "ppo", "f_phi", "d_omega", "normalizer", "exploration", "warm_start"):
        assert kept[section] == paper[section], section
    for section in ("training", "demonstrations"):
        changed = {name for name, value in paper[section].items() if kept[section][name] != value}
        assert changed <= SMALLER, section
    rows = pd.read_csv(folder / "results" / place / "metrics.csv")
    assert rows.env_steps.tolist() == [STEPS, 2 * STEPS]
    numbers = rows[["reward_env", "reward_gail", "f_phi_loss_discriminator", "loss_policy", "loss_critic"]]
    assert numbers.map(math.isfinite).all(None) and rows.reward_gail.between(0, 1).all()
    skill = Skill.load(folder / "runs" / place / "last", task="table_lack", subtask=1)
    expert = 8 * 20  # a demonstration takes more than 20 steps
    assert skill.normalizer.count > 2 * STEPS + expert  # it runs on through training
    assert json.loads((folder / "runs" / place / "finished.json").read_text())["env_steps"] == 2 * STEPS


def check_chain(folder: Path) -> None:
    rows = pd.read_csv(folder / "results/table_lack/tstar/seed0/metrics.csv")
    assert rows.skill.tolist() == [0, 1, 2, 3] and rows.env_steps.tolist() == [STEPS * i for i in range(1, 5)]
    assert rows.trial_progress.notna().tolist() == [False, False, False, True]
    assert "accepted" not in rows  # a skill stays what training made of it
    places = [f"table_lack/{system}/seed0" for system in ("gail_ppo", "tstar")]
    before, after = (
        Skill.load(folder / "runs" / place)
        for place in (f"{places[0]}/subtask1/last", f"{places[1]}/last/skill1")
    )
    assert after.normalizer.count == before.normalizer.count + STEPS  # it runs on
    handed = pd.read_csv(folder / "results/table_lack/hand_over.csv")
    assert len(handed) == 4 and handed.handed_over.isna().all()  # so short a training hands nothing over
    names = {path.name for path in (folder / "runs/table_lack/tstar/seed0/last").iterdir()}
    assert names == {f"skill{index}" for index in range(4)}
