"""A trained chain becomes a small file that knows where it comes from."""

import os
import re
from pathlib import Path

import pandas as pd
import pytest
import torch
import yaml
from hydra import compose, initialize_config_dir
from recipe_runs import load_recipe

from tstar_rl.chaining.chain import load_chain, save_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.shipped.catalogue import load_pretrained, pretrained

ROW = {
    "checkpoint": "last", "mode": "deterministic", "episodes": 8, "progress": 0.75, "success": 0.5,
    "success_low": 0.2, "success_high": 0.8, "subtask_0": 1.0, "subtask_1": 0.5, "subtask_2": None,
    "episode_length": 70.5, "env_steps": 100, "minutes": None, "seed": 4,
}  # fmt: skip


@pytest.fixture
def trained(tmp_path, monkeypatch):
    """A trained and evaluated chain of two skills below the working directory."""
    monkeypatch.chdir(tmp_path)
    settings = NetworkSettings(hidden=(8,), discriminator_hidden=(8,))
    save_chain([Skill("table_lack", i, settings) for i in range(2)], Path("runs/table_lack/tstar/seed4/last"))
    results = Path("results/table_lack/tstar/seed4")
    results.mkdir(parents=True)
    rows = [ROW, {**ROW, "mode": "stochastic"}, {**ROW, "checkpoint": "best"}, {**ROW, "seed": 0}]
    pd.DataFrame(rows).to_csv(results / "evaluation.csv", index=False)
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = plain(compose("recipe/tstar", ["scale=narrow", "seed=4"]))
    versions = {"torch": "2.13.0", "commit": "0" * 40}
    (results / "config.yaml").write_text(yaml.safe_dump({**config, "versions": versions}))
    return results


def test_a_chain_with_recovery_is_not_shipped(trained, call):
    """Whoever loaded it would run its skills without."""
    run = Path("runs/table_lack/tstar/seed4/last")
    save_chain(load_chain(run), run, recovery={"settings": {}, "shares": [1.0]})
    with pytest.raises(
        SystemExit, match="last is a chain with recovery, which evaluate.py and ways_home.py alone run"
    ):
        call("ship", "scale=narrow", "seed=4", "variant=mended", "says=goes home")
    assert not Path("runs/shipped").exists()


def test_skills_chained_as_they_are_may_be_one(trained):
    """Of a piece of one step."""
    skill = Path("runs/table_lack/gail_ppo/seed4/subtask0/last")
    Skill("table_lack", 0, NetworkSettings(hidden=(8,))).save(skill)
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/ship", ["system=no_finetuning", "seed=4", "task.subtasks=1"])
    assert load_recipe("ship")._folders(config) == [skill]


@pytest.mark.parametrize("name", ["ship", "export"])
def test_a_chain_that_is_replaced_while_it_is_read_goes_out_as_no_mixture(trained, say, monkeypatch, name):
    run, load = Path("runs/table_lack/tstar/seed4/last"), Skill.load

    def replaced_after_the_first(path, **expected):
        found = load(path, **expected)
        if path.name == "skill0":
            save_chain([Skill("table_lack", i, found.settings) for i in range(2)], run)
        return found

    monkeypatch.setattr(Skill, "load", replaced_after_the_first)
    values = {"ship": ["variant=mended", "says=fine-tuned"], "export": [f"path={run}", "formats=[hdf5]"]}
    assert "skill1 does not belong here: chain.id was" in say(name, "scale=narrow", "seed=4", *values[name])


def test_a_chain_is_shipped_with_what_is_known_of_it(trained, call, capsys):
    call("ship", "scale=narrow", "seed=4", "variant=mended", "says=fine-tuned", "signal=true")
    assert "runs/shipped/table_lack/mended: 2 skills, " in capsys.readouterr().out
    chain = load_pretrained("table_lack", "mended", folder="runs/shipped")
    record = {
        name: chain.record[name] for name in ("system", "scale", "seed", "checkpoint", "says", "versions")
    }
    assert record == {
        "system": "tstar", "scale": "narrow", "seed": 4, "checkpoint": "last", "says": "fine-tuned",
        "versions": {"torch": "2.13.0", "commit": "0" * 40},
    }  # fmt: skip
    assert chain.env_settings["preassembled"] == "ideal" and len(chain.d_omega) == 1
    figures = {name: value for name, value in ROW.items() if name not in ("checkpoint", "mode", "seed")}
    assert chain.record["figures"] == {"deterministic": figures, "stochastic": figures}
    skills = load_chain(Path("runs/table_lack/tstar/seed4/last"))
    for policy, skill in zip(chain.policies, skills, strict=True):
        for name, value in skill.policy.state_dict().items():
            assert torch.equal(policy.state_dict()[name], value)
    assert pretrained(folder="runs/shipped") == {"table_lack": ["mended"]}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            ["scale=laptop"],
            "seed4 is of another scale or config: env.preassembled was 'ideal' .* 'jitter' now",
        ),
        (["scale=narrow", "checkpoint=best"], "no chain at runs/table_lack/tstar/seed4/best: train it first"),
        (["scale=narrow", "seed=3"], "no chain at runs/table_lack/tstar/seed3/last"),
    ],
)
def test_another_chain_than_that_of_the_results_is_refused(trained, say, values, message):
    values = values if "seed=3" in values else [*values, "seed=4"]
    assert re.search(message, say("ship", *values))


@pytest.mark.parametrize("variant", ["ablations/starts/buffer", "..", "", "two words"])
def test_a_name_under_which_no_chain_is_found_is_refused(trained, say, variant):
    """Not that of the system: one that lies in folders is shipped under a name of one word."""
    said = f"variant must be one word, of letters, digits, _, - and ., got {variant!r}: chains are found at "
    assert said in say("ship", "scale=narrow", "seed=4", f"variant='{variant}'")
    assert not Path("runs/shipped").exists()


def test_a_system_in_folders_is_shipped_under_one_word(trained, call, say):
    for root in (Path("runs/table_lack"), Path("results/table_lack")):
        (root / "ablations/starts").mkdir(parents=True)
        (root / "tstar").rename(root / "ablations/starts/buffer")
    values = ["system=ablations/starts/buffer", "scale=narrow", "seed=4"]
    assert "variant must be one word" in say("ship", *values)
    call("ship", *values, "variant=buffer")
    assert pretrained(folder="runs/shipped") == {"table_lack": ["buffer"]}


def test_a_chain_that_was_not_evaluated_is_refused(trained, say):
    (trained / "evaluation.csv").unlink()
    said = "no evaluation of last at .*evaluation.csv: python recipes/evaluate.py system=tstar seed=4"
    assert re.search(said, say("ship", "scale=narrow", "seed=4"))
    (trained / "config.yaml").unlink()
    assert re.search("no config at .*config.yaml", say("ship", "scale=narrow", "seed=4"))


def test_a_table_without_a_figure_is_refused(trained, say):
    table = trained / "evaluation.csv"
    pd.read_csv(table).drop(columns="progress").to_csv(table, index=False)
    assert f"{table} is damaged (it has no column progress): put it back" in say(
        "ship", "scale=narrow", "seed=4"
    )


def test_figures_of_an_earlier_training_are_refused(trained, say):
    ended = Path("runs/table_lack/tstar/seed4/finished.json")
    ended.write_text("{}")
    os.utime(ended, (later := (trained / "evaluation.csv").stat().st_mtime + 10, later))
    said = "evaluation.csv is of an earlier training: evaluate this one first, python recipes/evaluate.py system=tstar"
    assert said in say("ship", "scale=narrow", "seed=4")
