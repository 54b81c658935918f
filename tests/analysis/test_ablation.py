"""Ablations: what their files say, what is run of them, and the figures that are made of their tables."""

import shutil
from pathlib import Path

import pandas as pd
import pytest
from hydra import compose, initialize_config_dir
from hydra.errors import MissingConfigException

from tstar_rl.analysis import ablation_figure, ablation_finding, ablation_table, load_ablation, variants
from tstar_rl.analysis.variants import SKILLS
from tstar_rl.config.overrides import key_of, known_to, section_of
from tstar_rl.config.ranges import chain_length
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.launch import side_by_side
from tstar_rl.rollouts.starts import check_shares

VARIANTS = [variant for name in variants.names() for variant in variants.read(name).variants]
TWO = {"reference": "a", "variants": [{"name": "a", "system": "tstar"}, {"name": "b", "system": "tstar"}]}


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.place)
def test_every_variant_is_a_config_of_training_and_of_evaluation(variant):
    values = ["scale=ablation", f"system={variant.place}", f"skills={SKILLS}", *variant.overrides]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        own = known_to(plain(compose("recipe/evaluate")), variant.overrides)
        evaluated = compose("recipe/evaluate", [*values[:3], *own])
        assert 2 <= chain_length(evaluated) <= 4
        of_the_world = {key_of(each).removeprefix("env.") for each in own if section_of(each) == "env"}
        assert of_the_world <= set(evaluated.demonstrations.may_differ), (
            "skills would be refused in that world"
        )
        if variant.trains:
            config = compose(f"recipe/{variant.system}", values)
            check_shares(config.chain.starts)
            assert config.skills == SKILLS


def test_an_evaluation_gets_the_values_that_it_has_and_not_a_recipes_own():
    given = ("chain.rounds=2", "+env.snap=true", "sigma=0.1", "++alpha=2", "~bonus")
    assert known_to({"chain": {}, "env": {}, "seed": 0}, given) == given[:2]


def test_the_same_run_is_made_once():
    paper = variants.read("lambda_3").variant("paper")
    buffer = variants.read("starts").variant("buffer")
    assert paper.first() == buffer.first() == variants.read("d_omega").variant("tstar")
    assert variants.read("d_omega").variant("no_bonus").first().overrides == ("reward.weights.tsr=0.0",)
    constant = variants.read("d_omega").variant("constant")
    assert constant.first() == constant and constant.source() == variants.read("d_omega").variant("tstar")
    firsts = {variant.first() for variant in VARIANTS}
    assert all(first.first() == first for first in firsts) and len(firsts) < len(VARIANTS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reference": "c"}, "ablation x has no variant 'c'; it has a, b"),
        (
            {"variants": [*TWO["variants"], {"name": "c", "system": "tstar", "bonus_of": "d"}]},
            "no variant 'd'",
        ),
        ({"variants": [*TWO["variants"], {"name": "a", "system": "tstar"}]}, "same name; it has a, b, a"),
        ({"variants": [{"name": "a", "sytem": "tstar"}]}, "no sytem; it has name, system, overrides"),
        ({"variants": [{"name": "a", "system": "no_finetuning"}]}, "call it no_finetuning"),
        (
            {"variants": [{"name": "no_finetuning_a", "system": "floored"}]},
            "is trained by floored, .* call it otherwise",
        ),
        ({"reference": None}, "reference must be text"),
        ({"variants": [{"name": "a"}]}, "a variant lacks system, which must be text"),
        (
            {"variants": [{"name": "a", "system": "tstar", "overrides": "chain.rounds=2"}]},
            "overrides must be a list, each text, got 'chain.rounds=2'",
        ),
        (
            {"variants": [{"name": "a", "system": "tstar", "bonus_of": "a"}]},
            "a has the bonus of a, which is paid another's itself",
        ),
        ({"refrence": "a"}, "has no refrence; .*did you mean reference"),
    ],
)
def test_mistakes_in_a_file_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        variants.parse("x", {**TWO, **change})


def test_an_unknown_ablation_is_named():
    with (
        initialize_config_dir(str(CONFIGS), version_base="1.3"),
        pytest.raises(MissingConfigException, match=r"(?s)ablation/lamda_3.*d_omega.*lambda_3"),
    ):
        compose("recipe/ablate", ["ablation=lamda_3"])
    with pytest.raises(ValueError, match="no ablation 'lamda_3'.* there are d_omega, lambda_3, links"):
        variants.read("lamda_3")


@pytest.mark.parametrize("failure", [SystemExit, OSError, RuntimeError])
def test_a_step_that_fails_ends_its_lane_alone(monkeypatch, failure):
    """Whether it is told, the disk's, or the program's."""
    done = []

    def run_recipe(step, shared, line):
        if step == ("bad",):
            raise failure("this step failed: bad")
        done.append(step[0])

    monkeypatch.setattr(side_by_side, "run_recipe", run_recipe)
    lanes = [[("a",), ("bad",), ("never",)], [("b",), ("c",)]]
    with pytest.raises(SystemExit, match="this step failed: bad"):
        side_by_side.run_side_by_side(lanes, [], 1)
    assert done == ["a", "b", "c"]


def tables(root: Path, **progress: list[float]) -> pd.DataFrame:
    """Of variants of `lambda_3`: one subtask's share, a number for each seed."""
    for variant, shares in progress.items():
        for seed, share in enumerate(shares):
            folder = root / "table_lack" / "ablations" / "lambda_3" / variant / f"seed{seed}"
            folder.mkdir(parents=True)
            row = {"checkpoint": "last", "mode": "deterministic", "episodes": 100, "seed": seed}
            row |= {"progress": share, "success": share, "subtask_0": share, "subtask_1": None}
            pd.DataFrame([row]).to_csv(folder / "evaluation.csv", index=False)
    return load_ablation("lambda_3", root)


def test_the_table_has_the_interval_of_seeds_and_episodes(tmp_path, capsys):
    rows = tables(tmp_path, zero=[0.5], paper=[0.4, 0.6], large=[0.5, 0.5])
    table = ablation_table(rows).loc["table_lack"]
    # One seed, 100 episodes: 1.96 x sqrt(0.25 / 100). Two seeds that agree: 200 episodes.
    assert table.loc["zero", "progress_high"] == pytest.approx(0.598, abs=0.011)
    assert table.loc["large", "progress_high"] == pytest.approx(0.5 + 0.098 / 2**0.5, abs=0.011)
    # Two that differ are drawn too: both times the worse one with probability 1/4.
    assert table.loc["paper", "progress_low"] < 0.40 and table.loc["paper", "progress"] == pytest.approx(0.5)
    assert list(table.index) == ["zero", "paper", "large"] and table.loc["paper", "episodes"] == 200
    assert table.loc["paper", "subtask_0"] == pytest.approx(0.5)
    out = capsys.readouterr().out
    assert "No table yet of no_finetuning, small" in out and "recipes/ablate.py ablation=lambda_3" in out


def test_a_run_that_was_copied_is_not_another_seed(tmp_path):
    tables(tmp_path, zero=[0.5])
    place = tmp_path / "table_lack/ablations/lambda_3/zero"
    shutil.copytree(place / "seed0", place / "seed1")
    with pytest.raises(ValueError, match=r"seed1/evaluation.csv has rows of seed 0: they are another run's"):
        load_ablation("lambda_3", tmp_path)


def test_the_finding_follows_the_table(tmp_path):
    rows = tables(tmp_path, zero=[0.2, 0.26], small=[0.6], paper=[0.5, 0.55], large=[0.4, 0.8])
    lines = ablation_finding(rows).splitlines()
    assert lines[0] == "table_lack, 2 seeds, differences in progress:"
    # Seeds say -0.30 and -0.29, and 1.96 sqrt(0.16 + 0.1924 + 0.25 + 0.2475) / 20 = 0.090 is from episodes.
    assert lines[1].startswith("  zero against paper: -0.295 [-0.") and lines[1].endswith(", lower")
    # On seed 0 alone: +0.1 +- 1.96 sqrt(0.24 + 0.25) / 10.
    assert lines[2].startswith("  small against paper: +0.100 [-0.0") and lines[2].endswith(
        "one seed (1 of them)"
    )
    assert lines[3].endswith("no clear difference")  # -0.1 and +0.25


def test_the_figure_has_a_dot_for_every_seed(tmp_path):
    figure = ablation_figure(tables(tmp_path, zero=[0.2, 0.25], paper=[0.5, 0.55, 0.6]))
    progress = figure.axes[0]
    assert [label.get_text() for label in progress.get_yticklabels()] == ["zero", "paper"]
    dots = [line.get_xdata().tolist() for line in progress.lines if line.get_marker() in ("o", "s")]
    assert dots == [[0.2, 0.25], [0.5, 0.55, 0.6]]


def test_a_finding_without_tables_says_what_makes_them(tmp_path):
    finding = ablation_finding(load_ablation("lambda_3", tmp_path))
    assert (
        finding == "No finding yet. This makes the tables: python recipes/ablate.py ablation=lambda_3 seed=0"
    )
