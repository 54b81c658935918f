"""The recipe that exchanges the skills of a fine-tuned chain for what they were before."""

import runpy
from pathlib import Path

import pandas as pd
import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from point_chain import PointChain, make_skills

from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS
from tstar_rl.env import furniture_env
from tstar_rl.runs.run_config import write_config

ROOT = Path(__file__).resolve().parents[2]


def test_a_chain_that_was_mended_by_its_first_skill(tmp_path, monkeypatch):
    make_skills(tmp_path)
    monkeypatch.setattr(furniture_env, "FurnitureEnv", PointChain)
    skills = [Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{i}/last") for i in range(4)]
    save_chain(skills, tmp_path / "runs/table_lack/plain/seed0/last")
    skills[0].policy[0][1].module[0][-1].bias.data[1] = (
        3.0  # it now ends where y > 0, from where skill 1 succeeds
    )
    for system in ("tstar", "other"):
        save_chain(skills, tmp_path / f"runs/table_lack/{system}/seed0/last")
    places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    for system, against in (("tstar", "null"), ("other", "null"), ("tstar", "null"), ("tstar", "plain")):
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            values = ["+env.max_steps=20", "progress_bar=false", "evaluation.episodes=64", f"system={system}"]
            config = compose("recipe/exchanged", [*places, *values, f"against={against}"])
        runpy.run_path(str(ROOT / "recipes/exchanged.py"))["main"].__wrapped__(config)
    table = pd.read_csv(tmp_path / "results/table_lack/exchanged.csv")
    assert len(table) == 2 * 3 * 4, "rows of the same chain are replaced"
    first = table[(table.system == "tstar") & (table.subtask == 1)].set_index(["handed_by", "taken_by"])
    assert (first.episodes == 64).all() and (first.handed == 64).all()
    for taken_by in ("before", "after"):
        assert first.success["before", taken_by] < 0.7 < 0.9 < first.success["after", taken_by]
    row = first.loc["after", "after"]
    assert row.success == row.taken / row.handed and row.success_low < row.success
    two = pd.read_csv(tmp_path / "results/table_lack/exchanged_plain.csv").set_index(
        ["handed_by", "taken_by"]
    )
    for versions, row in first.iterrows():  # the plain chain's skills are those before
        assert two[two.subtask == 1].loc[versions, "taken"] == row.taken
    assert (tmp_path / "results/table_lack/exchanged.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            ("from_checkpoint=best",),
            "must be null, got best: the training of tstar noted that it began from last",
        ),
        (
            ("from_checkpoint=best", "against=plain"),
            "is of the skills that a chain began with, and against=plain",
        ),
    ],
)
def test_other_skills_than_the_chain_began_with_are_refused(tmp_path, monkeypatch, values, message):
    make_skills(tmp_path)
    monkeypatch.setattr(furniture_env, "FurnitureEnv", PointChain)
    skills = [Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{i}/last") for i in range(4)]
    save_chain(skills, tmp_path / "runs/table_lack/tstar/seed0/last")
    places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/exchanged", [*places, "system=tstar", *values])
        trained = compose("recipe/tstar", places)
    write_config(tmp_path / "results/table_lack/tstar/seed0", OmegaConf.to_container(trained, resolve=True))
    with pytest.raises(InvalidValueError, match=message):
        runpy.run_path(str(ROOT / "recipes/exchanged.py"))["main"].__wrapped__(config)
