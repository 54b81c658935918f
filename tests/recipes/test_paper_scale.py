"""The paper's own figures, run: everything as in `configs/scale/paper.yaml` but the budget."""

import json
import math
from pathlib import Path

import pandas as pd
import pytest
import yaml
from hydra import compose, initialize_config_dir
from recipe_runs import run

from tstar_rl.chaining.skill import Skill
from tstar_rl.config.values import CONFIGS, plain

STEPS = 16 * 32  # of one rollout, by the paper's 16 simulations
BUDGET = [
    "demonstrations.episodes=8",
    "demonstrations.num_envs=8",
    "training.horizon=32",
    "training.total_steps=1024",
    "training.checkpoint_every=1024",
    "chain.rounds=2",  # in the first no d_omega pays: one learns in the next skill's turn
    f"chain.steps_per_turn={STEPS}",
    "chain.trial_episodes=8",
    "chain.trial_every=4",
]
PAPER = {  # a batch of the paper's has 128 rows on each of 16 workers
    # policy and value function
    "networks.hidden": [128, 128],
    "networks.value_hidden": [256, 256],
    "networks.activation": "relu",
    "networks.std": "state",
    "networks.features": False,
    "normalizer.running": True,
    # discriminators
    "networks.discriminator_hidden": [256, 256],
    "networks.discriminator_activation": "tanh",
    **{
        f"{network}.{name}": value
        for network in ("f_phi", "d_omega")
        for name, value in {
            "learning_rate": 1e-4,
            "gradient_penalty": 10.0,
            "penalty": "one_between",
            "minibatch": 128 * 16,
            "steps": 1024 // 128 // 4,
        }.items()
    },
    # PPO
    "training.num_envs": 16,
    "training.horizon": 1024,
    "ppo.minibatch": 128 * 16,
    "ppo.epochs": 10,
    "ppo.learning_rate": 3e-4,
    "ppo.linear_decay": True,
    "ppo.gamma": 0.99,
    "ppo.entropy_coeff": 0.003,
    # rewards
    "reward.reward_scale": 0.05,
    "reward.weights.env": 0.5,
    "reward.weights.gail": 0.5,
    # demonstrations, training and its task
    "demonstrations.episodes": 200,
    "demonstrations.kind": "plain",
    "warm_start": False,
    "exploration": None,
    "training.total_steps": 25_000_000,
    "training.max_steps": 150,
    "env.velocity_scale": 1.0,
    "env.preassembled": "ideal",
    "env.skipped_phases": "unpaid",
    # the evaluation that is reported
    "evaluation.episodes": 200,
    "evaluation.whole_episodes": 200,
}
"""The paper's figures and, where it has none, the released code's. Source: docs/task.md, "Training figures"."""
SMALLER = {"training.horizon", "training.total_steps", "demonstrations.episodes"}
"""Those that the slow test makes smaller."""


def flat(values: dict, prefix: str = "") -> dict:
    """Nested values by dotted names."""
    found = {}
    for name, value in values.items():
        inner = isinstance(value, dict)
        found |= flat(value, f"{prefix}{name}.") if inner else {f"{prefix}{name}": value}
    return found


def composed(recipe: str) -> dict:
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return flat(plain(compose(f"recipe/{recipe}", ["scale=paper", "subtask=0"])))


@pytest.mark.parametrize("recipe", ["gail_ppo", "tstar", "policy_sequencing"])
def test_the_scale_has_the_papers_figures(recipe):
    found = composed(recipe)
    assert {name: found[name] for name in PAPER} == PAPER


def test_a_chain_has_the_papers_figures():
    found, sequencing = composed("tstar"), composed("policy_sequencing")
    assert found["reward.weights.tsr"] == 10_000
    assert [found[f"chain.starts.{name}"] for name in ("environment", "gaussian", "buffer")] == [0.2, 0, 0.8]
    assert [sequencing[f"chain.starts.{name}"] for name in ("environment", "gaussian")] == [0.2, 0.8]
    steps = 4 * found["chain.rounds"] * found["chain.steps_per_turn"]
    assert steps == pytest.approx(100e6, rel=0.02)  # of chaining, over the four skills of a table
    update = found["training.num_envs"] * found["training.horizon"]
    assert found["chain.trial_every"] * found["chain.steps_per_turn"] / update == pytest.approx(50, rel=0.1)
    # A skill stays what training made of it, the sets begin empty, and pass i trains D of skill i.
    names = ("gate", "seed_episodes", "d_omega_of", "carry_over", "kept_states")
    assert [found[f"chain.{name}"] for name in names] == [False, 0, "own", True, "all"]


def test_on_a_gpu_an_environment_step_has_as_many_steps_of_the_optimisers():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        found = [compose("recipe/tstar", [f"scale={scale}"]) for scale in ("paper", "paper_gpu")]
    frames = [each.training.num_envs * each.training.horizon for each in found]
    for network in ("f_phi", "d_omega"):
        assert found[0][network].minibatch == found[1][network].minibatch
        assert found[0][network].steps / frames[0] == found[1][network].steps / frames[1]
    assert found[0].ppo.minibatch == found[1].ppo.minibatch and found[0].ppo.epochs == found[1].ppo.epochs


def test_cloning_has_the_papers_figures():
    found = composed("bc")
    assert [found[f"bc.{name}"] for name in ("epochs", "minibatch", "learning_rate")] == [1000, 256, 1e-4]


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
    kept = flat(yaml.safe_load((folder / "results" / place / "config.yaml").read_text()))
    for name in set(PAPER) - SMALLER:
        assert kept[name] == PAPER[name], name
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
    assert rows.skill.tolist() == 2 * [0, 1, 2, 3]
    assert rows.env_steps.tolist() == [STEPS * i for i in range(1, 9)]
    assert rows.trial_progress.notna().tolist() == 2 * [False, False, False, True]
    assert "accepted" not in rows  # a skill stays what training made of it
    places = [f"table_lack/{system}/seed0" for system in ("gail_ppo", "tstar")]
    before, after = (
        Skill.load(folder / "runs" / place)
        for place in (f"{places[0]}/subtask1/last", f"{places[1]}/last/skill1")
    )
    assert after.normalizer.count == before.normalizer.count + 2 * STEPS  # it runs on
    handed = pd.read_csv(folder / "results/table_lack/hand_over.csv")
    assert len(handed) == 4 and handed.handed_over.isna().all()  # so short a training hands nothing over
    names = {path.name for path in (folder / "runs/table_lack/tstar/seed0/last").iterdir()}
    assert names == {f"skill{index}" for index in range(4)}
