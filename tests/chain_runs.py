"""What happens to runs on the point chain in several tests: a kill, and turns that the gate puts back."""

from collections.abc import Callable

import pandas as pd
import pytest

from tstar_rl.chaining.training import Training
from tstar_rl.chaining.turns import Turn


@pytest.fixture
def whole_and_resumed(point_chain, monkeypatch) -> Callable[..., tuple[pd.DataFrame, pd.DataFrame]]:
    """Runs a recipe twice, as the systems `whole` and `cut`, in turns of one rollout; returns both tables.

    The second run is killed in turn 3, the fourth, and resumed: it begins with that turn, not anew. With `kills` it is
    killed in each of these, and resumed each time.
    """

    def run(recipe: str, *values: str, kills: tuple[int, ...] = (3,)) -> tuple[pd.DataFrame, pd.DataFrame]:
        values = (*values, "chain.steps_per_turn=512")
        whole = point_chain(recipe, *values, "system=whole")
        finish = Training._finish_rollout

        for turn in kills:

            def killed(training, rollout, turn=turn):
                if training.run.turn == turn:
                    raise KeyboardInterrupt
                return finish(training, rollout)

            with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
                patch.setattr(Training, "_finish_rollout", killed)
                point_chain(recipe, *values, "system=cut", resumable=True)
        begun, rollouts = [], Turn.rollouts

        def noted(turn):
            begun.append(turn.run.turn)
            return rollouts(turn)

        with monkeypatch.context() as patch:
            patch.setattr(Turn, "rollouts", noted)
            resumed = point_chain(recipe, *values, "system=cut", resumable=True)
        assert begun[0] == kills[-1]
        return whole, resumed

    return run


@pytest.fixture
def spoiled_turns(monkeypatch) -> None:
    """Every turn leaves a policy that walks backwards: the chain then gets nowhere, and a gate puts the turn back."""
    finish = Training._finish_rollout

    def spoil(training, rollout):
        training.skill.policy[0][1].module[0][-1].bias.data[0] = -1.0
        return finish(training, rollout)

    monkeypatch.setattr(Training, "_finish_rollout", spoil)
