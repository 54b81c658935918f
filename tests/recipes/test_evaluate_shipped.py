"""What `evaluate.py pretrained=...` evaluates, and that no chain's table is taken for another's."""

from pathlib import Path

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from recipe_runs import load_recipe

from tstar_rl.chaining.skill import Skill
from tstar_rl.config.values import CONFIGS
from tstar_rl.env.task_tables import furniture_digest
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.shipped.catalogue import CHAINS, load_pretrained
from tstar_rl.shipped.chain import save_shipped


@pytest.fixture(scope="module")
def recipe():
    return load_recipe("evaluate")


def test_a_shipped_chain_brings_its_task_seed_settings_and_episodes(recipe, call, tmp_path, capsys):
    record = load_pretrained("table_lack").record
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/evaluate", ["pretrained=table_lack", "task=chair_ingolf", "scale=narrow"])
    results, found = recipe._candidates(config, ["pretrained=table_lack"])
    assert results == Path("results/table_lack/pretrained/tstar") / f"seed{record['seed']}"
    assert config.pretrained_sha256 == found["last"].policy.sha256
    assert config.furniture == furniture_digest("table_lack")  # of its task, not of the one that was given
    assert (config.task.name, config.task.subtasks) == ("table_lack", 4) and config.env == record["env"]
    assert config.evaluation.whole_episodes == record["figures"]["deterministic"]["episodes"]
    assert (
        list(found) == [record["checkpoint"]] and found["last"].links == 4 and found["last"].subtask is None
    )
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        few = ["pretrained=table_lack", "evaluation={episodes: 3, whole_episodes: 20}"]
        config = compose("recipe/evaluate", few)
    recipe._candidates(config, few)
    assert config.evaluation.whole_episodes == 20
    values = [
        "modes=[deterministic]",
        "evaluation.whole_episodes=2",
        "video=false",
        "seed=5",
        "+env.max_steps=3",
    ]
    call("evaluate", "pretrained=table_lack/tstar", *values, f"results_dir={tmp_path}", module=recipe)
    table = pd.read_csv(tmp_path / "table_lack/pretrained/tstar/seed5/evaluation.csv")
    assert table[["checkpoint", "episodes", "episode_length"]].values.tolist() == [["last", 2, 12.0]]
    assert table.env_steps[0] == record["figures"]["deterministic"]["env_steps"]
    assert "another world than that of the figures recorded: env." in capsys.readouterr().out


def test_chains_of_one_s_own_have_a_table_of_their_own_each(recipe, call, say, tmp_path):
    """Beside that of the package's chain of the same name, and no row of one stands for another's."""
    figures = {"deterministic": {"episodes": 2, "progress": 0.0, "success": 0.0, "episode_length": 3.0}}

    def ship(folder: str, seed: int) -> None:
        torch.manual_seed(seed)
        skills = [Skill("table_lack", index, NetworkSettings(hidden=(8,))) for index in range(4)]
        known = {"task": "table_lack", "env": {}, "seed": 5, "checkpoint": "last", "figures": figures}
        save_shipped(skills, tmp_path / folder / "table_lack" / "tstar", signal=False, **known)

    values = ["pretrained=table_lack", "modes=[deterministic]", "evaluation.whole_episodes=2", "video=false"]
    values += ["seed=5", "+env.max_steps=3"]
    ship("mine", 0)
    ship("others", 1)
    call("evaluate", *values, module=recipe)
    own = Path("results/table_lack/pretrained/tstar/seed5/evaluation.csv")
    before = own.read_bytes()
    mine = Path("results/table_lack/shipped/tstar/seed5")
    for _ in range(2):
        call("evaluate", *values, "pretrained_dir=mine", module=recipe)
    assert own.read_bytes() == before and len(pd.read_csv(mine / "evaluation.csv")) == 1
    told = say("evaluate", *values, "pretrained_dir=others")
    assert f"{mine} has the results of another chain of this name, which was in mine: delete that" in told
    call(
        "evaluate", *values, f"pretrained_dir={CHAINS}", module=recipe
    )  # the package's, by the name of their folder
