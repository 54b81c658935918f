"""The turns of an experiment's chains as a table of the page."""

import math
from pathlib import Path
from textwrap import fill

import pandas as pd

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.figures import rise_figure, save_figure, signals_figure
from tstar_rl.analysis.page.markdown import (
    NOTHING,
    Paper,
    arm_label,
    arm_order,
    millions,
    picture,
    signal_label,
    table,
)
from tstar_rl.analysis.turns import signal_turns, turn_table

__all__ = ["draw_turns", "turns"]

RISE = (
    "Progress of the chain in the trials that follow turns. A thin line is a seed, a thick one their mean. Where "
    "trials are many, vertical lines stand at an eighth, a quarter, half and all of the steps, and every 20th trial "
    "has a marker."
)
TOLD = (
    "How well each signal told whether the next skill then succeeded (AUC), and by how much its scores differed, by "
    "seam. A dot is a turn of a seed, hollow where it was put back; a bar the mean over seeds of turns that were kept, "
    "with Student's 95% interval."
)

WIDTH = 34
"""Letters of a line beside the figure."""
SAID = """\
Means over seeds. Progress is that of the chain that goes on, in the trials after its turns: of two arms with the same
end, the one that rose earlier has more. AUC: how well the signal that paid a skill tells whether the next one then
succeeded (.5: nothing), with half of Student's 95% interval over seeds, over the turns that were kept and after which
it both succeeded and failed, which not all seeds may have; spread: the deviation of its scores over all turns that were
kept; neither is shown of an arm with several signals. Steps of trials: from experiment 0010 on they are with the
episodes of a chain before its first turn (chain.seed_episodes).
"""


def turns(metrics: pd.DataFrame, paper: Paper, task: str, prefix: str) -> str:
    """How the arms rose, and a line for each that was trained; nothing if none was."""
    found = turn_table(metrics, task)
    if found.empty:
        return ""
    rows = []
    for arm in arm_order(paper, found.index):
        row = found.loc[arm]
        numbers = [
            f"{row['trial_progress']:.3f}",
            _share(row["kept"]),
            _auc(row),
            _share(row["spread"]),
        ]
        line = [arm_label(paper, arm), f"{row['seeds']:.0f}", f"{row['trials']:.0f}", *numbers]
        rows.append([*line, millions(row["trial_steps"])])
    header = [
        "arm",
        "seeds",
        "trials",
        "progress in trials, mean",
        "turns kept",
        "AUC of the signal",
        "its spread",
    ]
    shown = f"{picture(RISE, _file(task, prefix))}\n{SAID}\n{table([*header, 'steps of trials'], rows)}"
    told = signal_turns(metrics, task)
    return shown if told.empty else f"{shown}\n{picture(TOLD, _told(task, prefix))}"


def draw_turns(
    experiment: Experiment, metrics: pd.DataFrame, paper: Paper, task: str, prefix: str, figures: Path
) -> list[Path]:
    """Writes the figure that `turns` shows, if it shows one; arms look as in the other figures of the experiment."""
    if turn_table(metrics, task).empty:
        return []
    labels = {arm: arm_label(paper, arm) for arm in arm_order(paper, experiment.chosen(task)["arm"])}
    found = [save_figure(rise_figure(metrics, task, labels), figures / f"{_file(task, prefix)}.png")]
    told = signal_turns(metrics, task)
    if len(told):
        figure = signals_figure(*_named(told, paper))
        found.append(save_figure(figure, figures / f"{_told(task, prefix)}.png"))
    return found


def _named(turns: pd.DataFrame, paper: Paper) -> tuple[pd.DataFrame, dict[str, str]]:
    """The turns, each arm and signal under one name, and what each is called: by its arm, unless that has several."""
    labels = {}
    for arm in arm_order(paper, turns["arm"]):
        signals = turns.loc[turns["arm"] == arm, "signal"].unique()
        for signal in signals:
            labels[f"{arm} {signal}"] = fill(signal_label(paper, arm, signal, len(signals)), WIDTH)
    return turns.assign(signal=turns["arm"] + " " + turns["signal"]), labels


def _file(task: str, prefix: str) -> str:
    return f"{prefix}{task}_rise"


def _told(task: str, prefix: str) -> str:
    return f"{prefix}{task}_signals"


def _auc(row: pd.Series) -> str:
    """With of how many seeds, where some have none."""
    half = "" if math.isnan(row["auc_half"]) else f" +- {row['auc_half']:.2f}"
    some = 0 < row["auc_seeds"] < row["seeds"]
    return (
        _share(row["auc"]) + half + (f" ({row['auc_seeds']:.0f} of {row['seeds']:.0f} seeds)" if some else "")
    )


def _share(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.2f}"
