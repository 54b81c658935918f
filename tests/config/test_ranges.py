"""Values that name what a recipe does are checked before it begins, those in lists too."""

import inspect

import pytest
import torch

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.limits import MODES
from tstar_rl.config.ranges import check_ranges_of
from tstar_rl.config.unread import MOMENTUM, PAPERS
from tstar_rl.rollouts import episodes
from tstar_rl.transforms import TerminalStateReward

CONFIG = {"task": {"name": "table_lack", "subtasks": 4}, "subtask": None}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"formats": []}, "formats must name at least one, got none: there would be nothing to do"),
        ({"modes": ["deterministic", "x"]}, "mode must be one of deterministic, stochastic; got 'x'"),
        ({"modes": ["stochastic"] * 2}, "modes must name each once, got stochastic, stochastic"),
        ({"checkpoints": ["last", "last"]}, "checkpoints must name each once, got last, last"),
        ({"mode": "x"}, "mode must be one of deterministic, stochastic; got 'x'"),
        ({"kinds": ["plain", "x"]}, "kind must be one of plain, noisy; got 'x'"),
        (
            {"demonstrations": {"kind": "plain", "may_differ": ["nix"]}},
            "may_differ has 'nix'; valid settings: veloc",
        ),
    ],
)
def test_a_name_that_is_none_is_told(values, message):
    with pytest.raises(InvalidValueError, match=message):
        check_ranges_of({**CONFIG, **values})


def test_names_that_are_some_pass():
    lists = {"formats": ["hdf5"], "modes": ["stochastic"], "mode": "stochastic", "kinds": ["noisy"]}
    check_ranges_of({**CONFIG, **lists, "demonstrations": {"kind": "plain", "may_differ": ["snap"]}})
    assert tuple(episodes.MODES) == MODES


def test_the_momentum_that_is_not_set_is_the_one_that_the_reward_has():
    reward = TerminalStateReward(torch.nn.Identity())
    assert inspect.signature(TerminalStateReward).parameters["momentum"].default == MOMENTUM
    assert all(getattr(reward, name) == value for name, value in PAPERS.items())
