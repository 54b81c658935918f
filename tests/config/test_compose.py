"""A recipe's config without its command line."""

import pytest
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from recipe_runs import load_recipe

import tstar_rl as rl
from tstar_rl.config.check import ConfigError
from tstar_rl.config.values import CONFIGS


def test_values_are_those_of_the_command_line():
    config = rl.compose("tstar", "seed=1", "chain.rounds=2")
    assert (config.system, config.seed, config.chain.rounds, config.from_checkpoint) == (
        "tstar",
        1,
        2,
        "last",
    )
    assert not GlobalHydra.instance().is_initialized()


def test_a_recipe_that_asks_its_command_line_says_so_without_one(tmp_path):
    config = rl.compose("evaluate", f"results_dir={tmp_path}", f"runs_dir={tmp_path}")
    with pytest.raises(
        rl.InvalidValueError, match="evaluate asks its command line: run it as python recipes/eval"
    ):
        load_recipe("evaluate").main(config)


@pytest.mark.parametrize(
    ("values", "kind", "message"),
    [
        (["tstr"], rl.InvalidValueError, "no recipe is called 'tstr': .*; did you mean tstar"),
        (["tstar", "sed=1"], ConfigError, "the config has no sed; .*did you mean seed"),
        (["tstar", "chain.rounds=0"], ConfigError, "chain.rounds must be at least 1, got 0"),
        (["tstar", "scale=lptop"], ConfigError, "scale must be one of ablation, .*did you mean laptop"),
        (
            ["tstar", "terminal_reward.baseline=running_mean", "terminal_reward.momentum=0.5"],
            ConfigError,
            r"write \+terminal_reward.momentum=",
        ),
        (["tstar", "a b"], ConfigError, "cannot read 'a b': write key=value"),
    ],
)
def test_mistakes_are_told_as_on_the_command_line(values, kind, message):
    with pytest.raises(kind, match=message):
        rl.compose(*values)


def test_every_recipe_has_one():
    assert rl.compose("bench").bench.rounds > 0 and rl.compose("bench_growth").growth.steps > 0


def test_a_program_with_configs_of_its_own_keeps_them():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        around = GlobalHydra.instance().hydra
        rl.compose("gail_ppo", "subtask=0")
        assert GlobalHydra.instance().hydra is around
