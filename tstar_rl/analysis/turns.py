"""What the turns of chains say: how fast an arm rises in its trials, what trials cost, and what a signal tells."""

import math
from collections.abc import Iterable

import pandas as pd

from tstar_rl.analysis.differences import student_half

__all__ = ["AUC", "SPREAD", "kept_turns", "signal_turns", "steps_of_trials", "tried_turns", "turn_table"]

AUC, SPREAD = "_auc", "_sd"
"""Endings of the columns that say how well a signal's scores tell whether the next skill then succeeded, and by how
much the scores differ."""


def tried_turns(metrics: pd.DataFrame, task: str) -> pd.DataFrame:
    """The rows after which a chain of a task was tried, one for each turn that a trial followed.

    Args:
        metrics: of `read_metrics`.
        task: of the chains.
    """
    if "trial_progress" not in metrics:
        return metrics.iloc[:0]
    rows = _chains(metrics, task)
    return rows[rows["trial_progress"].notna()]


def steps_of_trials(metrics: pd.DataFrame, task: str) -> pd.Series:
    """Environment steps of the trials of each arm's chain, and of the episodes before its first turn.

    Runs of before experiment 0010 have not counted these (chain.seed_episodes): of them it is the trials alone.

    Args:
        metrics: see `tried_turns`.
        task: see `tried_turns`.

    Returns:
        Index arm; mean over seeds. Nothing where such steps were not logged.
    """
    if "trial_steps" not in metrics:
        return pd.Series(dtype=float)
    of_seeds = _chains(metrics, task).groupby(["recipe", "seed"])["trial_steps"].sum(min_count=1)
    return of_seeds.groupby("recipe").mean()


def turn_table(metrics: pd.DataFrame, task: str) -> pd.DataFrame:
    """A line for each arm whose chain was tried after turns: after every one where a gate judges it.

    Args:
        metrics: see `tried_turns`.
        task: see `tried_turns`.

    Returns:
        Index arm; means over seeds. Columns seeds, trials (of a seed), trial_progress (of the chain that goes on, over
        all trials: of an arm that rises early it is higher at the same end), kept (share of tried turns that the gate
        kept), trial_steps (see `steps_of_trials`), auc and spread (of the scores of the arm's signal, over the turns
        that were kept; auc of those alone after which the next skill both succeeded and failed; nan where nothing
        signals, or several signals were judged, for which see `calibration.calibration_of_arms`), auc_half (of
        Student's 95% interval over seeds) and auc_seeds (how many have an AUC); spread_half and spread_seeds.
    """
    rows, steps, lines = tried_turns(metrics, task), steps_of_trials(metrics, task), {}
    if rows.empty:
        return pd.DataFrame()
    for arm, mine in rows.groupby("recipe"):
        seeds = mine.groupby("seed")
        line = {"seeds": len(seeds), "trials": seeds.size().mean()}
        line["trial_progress"] = seeds["trial_progress"].mean().mean()
        line["kept"] = float(_of_seeds(mine, ["accepted"]).mean())
        line["trial_steps"] = steps.get(arm, math.nan)
        kept = kept_turns(mine)
        for name, ending in (("auc", AUC), ("spread", SPREAD)):
            of_seeds = _of_seeds(kept, [column for column in mine if str(column).endswith(ending)])
            line[name] = float(of_seeds.mean())
            line[f"{name}_half"] = student_half(of_seeds.to_numpy())
            line[f"{name}_seeds"] = len(of_seeds)
        lines[str(arm)] = line
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("arm")


def signal_turns(metrics: pd.DataFrame, task: str) -> pd.DataFrame:
    """A row for each turn of a task's chains and each signal that was held against what the next skill then did.

    Args:
        metrics: see `tried_turns`.
        task: see `tried_turns`.

    Returns:
        Columns arm, signal, seed, skill and round (from 0), kept (not put back by a gate), auc (nan where all outcomes
        were alike) and spread.
    """
    rows, found = tried_turns(metrics, task), []
    for column in [name for name in rows if str(name).endswith(AUC)]:
        signal = str(column).removesuffix(AUC)
        spread = rows.get(f"{signal}{SPREAD}", pd.Series(math.nan, rows.index))
        mine = pd.DataFrame(
            {
                "arm": rows["recipe"],
                "signal": signal,
                "seed": rows["seed"],
                "skill": rows["skill"].astype(int),
                "round": rows["round"].astype(int) if "round" in rows else 0,
                "kept": (rows["accepted"] != 0) if "accepted" in rows else True,
                "auc": rows[column],
                "spread": spread,
            }
        )
        found.append(mine[mine["auc"].notna() | mine["spread"].notna()])
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame()


def kept_turns(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows that no gate put back."""
    return rows[rows["accepted"] != 0] if "accepted" in rows else rows


def _chains(metrics: pd.DataFrame, task: str) -> pd.DataFrame:
    """The rows of whole chains."""
    return metrics[(metrics["task"] == task) & (metrics["subtask"] == -1)]


def _of_seeds(rows: pd.DataFrame, columns: Iterable[str]) -> pd.Series:
    """Of each seed, the mean over turns of the one column that an arm has; empty if it has none, or several."""
    there = [name for name in columns if name in rows and rows[name].notna().any()]
    found = rows.groupby("seed")[there[0]].mean() if len(there) == 1 else pd.Series(dtype=float)
    return found.dropna()
