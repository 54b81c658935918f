"""How far the signals of an experiment are probabilities, as a table and a figure of the page."""

import math
from pathlib import Path

import pandas as pd

from tstar_rl.analysis.calibration import calibration_of_arms, pooled
from tstar_rl.analysis.figures import reliability_figure, save_figure
from tstar_rl.analysis.page.markdown import NOTHING, Paper, arm_order, picture, signal_label, table
from tstar_rl.analysis.tables import config_of, read_calibration

__all__ = ["calibration", "draw_calibration"]

SHOWN = ("auc", "brier", "rate", "ece")
CURVE = "What signals said of the states that were handed over, and what then happened; all turns and seeds together."
SAID = """\
Means over the turns that were kept, then over seeds. Brier score: the mean squared distance of what was said from what
happened; beside it that of saying of every state how often the next skill succeeded in that trial, which is no
yardstick for a signal that predicts how much of the rest is done. Calibration error:
how far the two are apart in ten bins of what was said. An AUC is of the turns alone after which the next skill both
succeeded and failed: so many, of all seeds together, are behind it.
"""


def calibration(folder: Path, metrics: pd.DataFrame, paper: Paper, task: str, prefix: str) -> str:
    """A line for each arm whose signal was judged, and the figure of their curves; nothing if none was."""
    found = calibration_of_arms(metrics, task, _shares(folder, task))
    if found.empty or _curves(folder, task).empty:
        return ""
    rows = []
    for arm in arm_order(paper, found.index.get_level_values("arm")):
        signals = found.loc[arm]
        for signal, row in signals.iterrows():
            numbers = [NOTHING if math.isnan(row[name]) else f"{row[name]:.2f}" for name in SHOWN]
            turns = [f"{row['seeds']:.0f}", f"{row['told']:.0f}"]
            rows.append([signal_label(paper, arm, str(signal), len(signals)), *turns, *numbers])
    header = [
        "arm",
        "seeds",
        "turns with an AUC",
        "AUC",
        "Brier score",
        "of saying the rate",
        "calibration error",
    ]
    return f"{picture(CURVE, _file(task, prefix))}\n{SAID}\n{table(header, rows)}"


def draw_calibration(
    folder: Path, metrics: pd.DataFrame, paper: Paper, task: str, prefix: str, figures: Path
) -> list[Path]:
    """Writes the figure that `calibration` shows, if it shows one."""
    curves = _curves(folder, task)
    if calibration_of_arms(metrics, task).empty or curves.empty:
        return []
    together, drawn = pooled(curves), []
    for arm in arm_order(paper, curves["recipe"]):
        of_arm = together[together["recipe"] == arm]
        names = {
            signal: signal_label(paper, arm, signal, of_arm["signal"].nunique())
            for signal in of_arm["signal"]
        }
        drawn.append(of_arm.assign(signal=of_arm["signal"].map(names)))
    return [save_figure(reliability_figure(pd.concat(drawn)), figures / f"{_file(task, prefix)}.png")]


def _shares(folder: Path, task: str) -> set[str]:
    """Arms whose signal predicts how much of the rest of the chain is done (`label: share`)."""
    runs = (file.parent for file in folder.glob(f"{task}/*/seed*/config.yaml"))
    return {run.parent.name for run in runs if config_of(run).get("label") == "share"}


def _curves(folder: Path, task: str) -> pd.DataFrame:
    found = read_calibration(folder)
    return found if found.empty else found[found["task"] == task]


def _file(task: str, prefix: str) -> str:
    return f"{prefix}{task}_calibration"
