"""Two arms beside each other in the notes: in each way of reading them, and at each seam."""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from tstar_rl.analysis.differences import outer_ends, paired_difference, signed_interval
from tstar_rl.analysis.experiments import SEED, Experiment, check_arms
from tstar_rl.analysis.hand_overs import compare_hand_overs, signal_by_seam
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import NOTHING, Paper, arm_label, table
from tstar_rl.analysis.tables import read_metrics
from tstar_rl.checks import InvalidValueError

__all__ = ["readings", "seams"]

ACTIONS = {"deterministic": "deterministic", "stochastic": "sampled"}


def readings(experiment: Experiment, paper: Paper, entry: Entry, task: str, arms: Sequence[str]) -> str:
    """A pair's difference by checkpoint, by kind of action, and by what is counted; nothing if no seed is in both.

    Args:
        experiment: of runs.
        paper: of no use here.
        entry: of no use here.
        task: one of the experiment's.
        arms: the first and the second.

    Raises:
        InvalidValueError: unless two arms are named, which the task has.
    """
    first, second = _two(experiment, task, arms)
    lines = []
    for checkpoint in ("last", "best"):
        for mode, said in ACTIONS.items():
            scores = experiment.scores(checkpoint, mode).get(task, {})
            one, other = (scores.get(arm, {}) for arm in (first, second))
            if not set(one) & set(other):
                continue
            line = [f"{checkpoint} checkpoint, {said} actions", str(len(set(one) & set(other)))]
            for whole in (False, True):
                pair = [
                    {seed: each >= 1.0 if whole else each for seed, each in arm.items()}
                    for arm in (one, other)
                ]
                found = paired_difference(*pair, np.random.default_rng(SEED))
                ends = outer_ends(found.value, found.low, found.high, found.t_half)
                line.append(signed_interval(found.value, *ends))
            lines.append(line)
    header = ["difference", "seeds", "progress [95%]", "the whole task [95%]"]
    return table(header, lines) if lines else ""


def seams(experiment: Experiment, paper: Paper, entry: Entry, task: str, arms: Sequence[str]) -> str:
    """How often the skill that takes over succeeds, in chains of two arms, and what the first arm's signal told of it.

    Args:
        experiment: of runs.
        paper: with the arms' labels.
        entry: of no use here.
        task: one of the experiment's.
        arms: the first and the second.

    Raises:
        InvalidValueError: unless two arms are named, which the task has.
    """
    first, second = _two(experiment, task, arms)
    found = compare_hand_overs(experiment.chosen(task), first, second)
    told = signal_by_seam(read_metrics(experiment.root), task, first)
    lines = []
    for subtask, row in found.iterrows():
        ends = (row["difference"] - row["t_half"], row["difference"] + row["t_half"])
        line = [f"skill {subtask} to skill {int(str(subtask)) + 1}", f"{row['seeds']:.0f}"]
        line += [f"{row['first']:.3f}", f"{row['second']:.3f}", signed_interval(row["difference"], *ends)]
        lines.append([*line, *_told(told.loc[subtask] if subtask in told.index else None, row["of"])])
    next_one = "the next succeeds"
    header = ["seam", "seeds", f"{next_one}: {arm_label(paper, first)}", arm_label(paper, second)]
    header += ["difference [95%, Student's t]", "AUC of the first arm's signal [95%]", "its spread"]
    if told.empty:
        header, lines = header[:-2], [line[:-2] for line in lines]
    return table(header, lines) if lines else ""


def _told(row: pd.Series | None, seeds: tuple[int, ...]) -> list[str]:
    """AUC and spread; how many seeds have an AUC where these are not the difference's, and if some are others."""
    if row is None:
        return [NOTHING, NOTHING]
    if not row["of"]:
        return [NOTHING, f"{row['spread']:.2f}"]
    half = "" if math.isnan(row["auc_half"]) else f" +- {row['auc_half']:.2f}"
    others = ", others too" if set(row["of"]) - set(seeds) else ""
    of = "" if set(row["of"]) == set(seeds) else f" ({row['seeds']:.0f} seeds{others})"
    return [f"{row['auc']:.2f}{half}{of}", f"{row['spread']:.2f}"]


def _two(experiment: Experiment, task: str, arms: Sequence[str]) -> tuple[str, str]:
    if len(arms) != 2:
        raise InvalidValueError(f"a pair of arms is two, got {', '.join(arms) or 'none'}")
    check_arms(task, arms, experiment.chosen(task)["arm"].unique())
    return arms[0], arms[1]
