"""How far the signals of an experiment are probabilities, as a table and a figure of the page."""

from pathlib import Path

import pandas as pd

from tstar_rl.analysis.calibration import calibration_of_arms, pooled
from tstar_rl.analysis.figures import reliability_figure, save_figure
from tstar_rl.analysis.page.markdown import Paper, arm_label, arm_order, picture, table
from tstar_rl.analysis.tables import read_calibration

__all__ = ["calibration", "draw_calibration"]

CURVE = "What signals said of the states that were handed over, and what then happened; all turns and seeds together."
SAID = """\
Means over the turns that were kept, then over seeds. Brier score: the mean squared distance of what was said from what
happened; beside it that of saying of every state how often the next skill succeeded in that trial. Calibration error:
how far the two are apart in ten bins of what was said.
"""


def calibration(folder: Path, metrics: pd.DataFrame, paper: Paper, task: str, prefix: str) -> str:
    """A line for each arm whose signal was judged, and the figure of their curves; nothing if none was."""
    found = calibration_of_arms(metrics, task)
    if found.empty or _curves(folder, task).empty:
        return ""
    rows = []
    for arm in arm_order(paper, found.index):
        row = found.loc[arm]
        numbers = [f"{row[name]:.2f}" for name in ("auc", "brier", "rate", "ece")]
        rows.append([arm_label(paper, arm), f"{row['seeds']:.0f}", *numbers])
    header = ["arm", "seeds", "AUC", "Brier score", "of saying the rate", "calibration error"]
    return f"{picture(CURVE, _file(task, prefix))}\n{SAID}\n{table(header, rows)}"


def draw_calibration(
    folder: Path, metrics: pd.DataFrame, paper: Paper, task: str, prefix: str, figures: Path
) -> list[Path]:
    """Writes the figure that `calibration` shows, if it shows one."""
    curves = _curves(folder, task)
    if calibration_of_arms(metrics, task).empty or curves.empty:
        return []
    arms = arm_order(paper, curves["recipe"])
    together = pooled(curves)
    drawn = pd.concat(
        [together[together["recipe"] == arm].assign(signal=arm_label(paper, arm)) for arm in arms]
    )
    return [save_figure(reliability_figure(drawn), figures / f"{_file(task, prefix)}.png")]


def _curves(folder: Path, task: str) -> pd.DataFrame:
    found = read_calibration(folder)
    return found if found.empty else found[found["task"] == task]


def _file(task: str, prefix: str) -> str:
    return f"{prefix}{task}_calibration"
