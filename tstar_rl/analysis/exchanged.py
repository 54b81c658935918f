"""What exchanging the skills of a seam between two chains says: where the first ends, or how the second takes over."""

import numpy as np
import pandas as pd

from tstar_rl.analysis.differences import Difference, difference_of
from tstar_rl.analysis.statistics import RESAMPLES, Array, resampled_means, seed_means
from tstar_rl.checks import InvalidValueError

__all__ = ["EFFECTS", "effects_of_seeds", "exchange_effects"]

SEED = 0
"""Of the bootstrap."""
CELLS = (("after", "after"), ("before", "after"), ("after", "before"), ("before", "before"))
"""By whom a state is handed over, and who takes over."""
EFFECTS = {"ends": (1, -1, 1, -1), "taking over": (1, 1, -1, -1), "both": (2, 0, 0, -2)}
"""Signs of the second skill's success in `CELLS`, halved: what the first skill's ends add, what the second skill adds
by how it takes over, and their sum."""


def exchange_effects(table: pd.DataFrame) -> pd.DataFrame:
    """How much the second skill's success gains by either skill of a seam, over seeds.

    Args:
        table: of `recipes/exchanged.py`, the rows of one chain's system and checkpoint; each seed has all of `CELLS`.

    Raises:
        InvalidValueError: for rows of several systems or checkpoints, or a seam of a seed that lacks a cell.

    Returns:
        A line for each seam and effect: subtask (of the second skill), effect (of `EFFECTS`) and the fields of
        `Difference`, with its verdict. Seeds in which one of the first skills hands nothing over are left out.

    Source: the two main effects of a 2 x 2 design, Box, Hunter and Hunter, Statistics for Experimenters, 1978.
    """
    for name in ("system", "checkpoint"):
        if name in table and table[name].nunique() > 1:
            raise InvalidValueError(f"effects are of one {name}, got {', '.join(sorted(set(table[name])))}")
    lines = []
    for subtask, rows in table.groupby("subtask"):
        numbers = rows.groupby("seed").size()
        if (numbers != len(CELLS)).any():
            wrong = ", ".join(map(str, numbers[numbers != len(CELLS)].index))
            raise InvalidValueError(f"skill {subtask} needs {len(CELLS)} rows of each seed; not so: {wrong}")
        reached = rows.groupby("seed")["handed"].transform("min") > 0
        cells = [_outcomes(rows[reached], *cell) for cell in CELLS]
        if not cells[0]:
            continue
        for effect, signs in EFFECTS.items():
            found = _effect(cells, signs)
            lines.append(
                {"subtask": subtask, "effect": effect, **found._asdict(), "verdict": found.verdict()}
            )
    return pd.DataFrame(lines)


def effects_of_seeds(table: pd.DataFrame) -> pd.DataFrame:
    """The effects of each seed, whose means over seeds are those of `exchange_effects`.

    Args:
        table: see `exchange_effects`.

    Returns:
        Columns subtask (of the second skill), effect, seed and value.
    """
    lines = []
    for (subtask, seed), rows in table.groupby(["subtask", "seed"]):
        if rows["handed"].min() == 0:
            continue
        share = (rows["taken"] / rows["handed"]).to_numpy()
        by_cell = dict(zip(zip(rows["handed_by"], rows["taken_by"], strict=True), share, strict=True))
        success = [by_cell[cell] for cell in CELLS]
        for effect, signs in EFFECTS.items():
            value = sum(sign / 2 * each for sign, each in zip(signs, success, strict=True))
            lines.append({"subtask": subtask, "effect": effect, "seed": seed, "value": value})
    return pd.DataFrame(lines)


def _outcomes(rows: pd.DataFrame, handed_by: str, taken_by: str) -> list[Array]:
    """Of each seed, in order, 1 for each hand-over that was taken and 0 for each that was not."""
    mine = rows[(rows["handed_by"] == handed_by) & (rows["taken_by"] == taken_by)].sort_values("seed")
    return [
        np.repeat([1.0, 0.0], [taken, handed - taken])
        for taken, handed in zip(mine["taken"], mine["handed"], strict=True)
    ]


def _effect(cells: list[list[Array]], signs: tuple[int, ...]) -> Difference:
    """The cells' success summed by halved signs, mean over seeds; bootstrap over seeds and episodes, Student's t."""
    number, rng = len(cells[0]), np.random.default_rng(SEED)
    chosen = rng.integers(number, size=(RESAMPLES, number))

    def summed(means: list[Array]) -> Array:
        return np.sum([sign / 2 * each for sign, each in zip(signs, means, strict=True)], axis=0)

    of_seeds = summed([seed_means(cell) for cell in cells])
    draws = summed([resampled_means(cell, chosen, rng) for cell in cells]).mean(-1)
    return difference_of(of_seeds, draws)
