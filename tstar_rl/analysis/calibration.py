"""How far the scores of signals are probabilities: what they said of states, and what then happened."""

import math
from collections.abc import Collection

import pandas as pd

from tstar_rl.analysis.turns import kept_turns

__all__ = ["calibration_of_arms", "pooled"]

BRIER, BINS = "_brier", 10
COLUMNS = ("auc", "brier", "ece")


def calibration_of_arms(metrics: pd.DataFrame, task: str, shares: Collection[str] = ()) -> pd.DataFrame:
    """A line for each arm and signal that was judged, over the turns that were kept.

    Args:
        metrics: of `read_metrics`.
        task: of the chains.
        shares: arms whose signal predicts how much of the rest is done, not whether the next skill succeeds.

    Returns:
        Index arm and signal; means over turns, then over seeds. Columns seeds, auc, told (the turns behind it, of all
        seeds: those after which the next skill both succeeded and failed), brier, ece and rate, the Brier score of
        saying of every state how often the next skill succeeded in that trial: nan for `shares`, which are judged
        against something else.
    """
    signals = [str(name).removesuffix(BRIER) for name in metrics if str(name).endswith(BRIER)]
    lines = {}
    for signal in signals:
        judged = (metrics["task"] == task) & (metrics["subtask"] == -1) & metrics[f"{signal}{BRIER}"].notna()
        rows = kept_turns(metrics[judged])
        rows = rows.assign(rate=rows["next_success"] * (1 - rows["next_success"]))
        named = [*(f"{signal}_{column}" for column in COLUMNS), "rate"]
        for arm, mine in rows.groupby("recipe"):
            seeds = mine.groupby("seed")[named].mean()
            values = dict(zip((*COLUMNS, "rate"), seeds.mean(), strict=True))
            values["rate"] = math.nan if arm in shares else values["rate"]
            told = int(mine[f"{signal}_auc"].notna().sum())
            lines[str(arm), signal] = {"seeds": len(seeds), "told": told, **values}
    return pd.DataFrame(list(lines.values()), index=pd.MultiIndex.from_tuples(lines, names=["arm", "signal"]))


def pooled(table: pd.DataFrame) -> pd.DataFrame:
    """The bins of all turns and seeds together, by arm, signal and skill.

    Args:
        table: rows of `read_calibration`, of one task.

    Returns:
        Columns recipe, signal, skill, score, outcome (means over the states of a bin), states.
    """
    place = (table["score"] * BINS).astype(int).clip(upper=BINS - 1)
    rows = table.assign(
        bin=place, score=table["score"] * table["states"], outcome=table["outcome"] * table["states"]
    )
    sums = rows.groupby(["recipe", "signal", "skill", "bin"], as_index=False)[
        ["score", "outcome", "states"]
    ].sum()
    for name in ("score", "outcome"):
        sums[name] /= sums["states"]
    return sums.drop(columns="bin")
