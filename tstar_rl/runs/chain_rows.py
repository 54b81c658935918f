"""What a chain's terminal_states.csv and calibration.csv have, row by row; `Run` keeps both tables."""

from collections.abc import Iterable, Iterator
from typing import Any

from torch import Tensor

__all__ = ["calibration_rows", "terminal_state_rows"]


def terminal_state_rows(env_steps: int, skill: int, poses: Tensor) -> Iterator[dict[str, Any]]:
    """One row for each state in which a skill succeeded.

    Args:
        env_steps: of the run so far.
        skill: which of the chain.
        poses: (n, 7 P), position in m and quaternion of each part, world.
    """
    for pose in poses.tolist():
        numbers = {f"pose_{index}": round(number, 5) for index, number in enumerate(pose)}
        yield {"env_steps": env_steps, "skill": skill, **numbers}


def calibration_rows(
    env_steps: int, skill: int, signal: str, curve: Iterable[Tensor]
) -> Iterator[dict[str, Any]]:
    """One row for each bin of a reliability curve.

    Args:
        env_steps: of the run so far.
        skill: after which the states were handed over.
        signal: that scored them.
        curve: mean score, mean outcome and number of states of each bin, (b,) each.
    """
    for score, outcome, states in zip(*(each.tolist() for each in curve), strict=True):
        numbers = {"score": score, "outcome": outcome, "states": states}
        yield {"env_steps": env_steps, "skill": skill, "signal": signal, **numbers}
