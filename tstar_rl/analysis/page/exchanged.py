"""What exchanging the skills of a seam between two arms says, as a part of the page."""

from pathlib import Path

from tstar_rl.analysis.differences import outer_ends, signed_interval
from tstar_rl.analysis.exchanged import effects_of_seeds, exchange_effects
from tstar_rl.analysis.figures import effects_figure, save_figure
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import Paper, arm_label, picture, table
from tstar_rl.runs.csv_tables import read_table

__all__ = ["draw_exchanged", "exchanged"]

WORDS = {"ends": "where the first skill ends", "taking over": "how the second takes over"}
SHOWN = (
    "What either skill of a seam adds to the second one's success when it is exchanged between the two chains of a "
    "seed: {first} less {second}. A dot is a seed; a bar the mean with the wider 95% interval."
)


def exchanged(entry: Entry, paper: Paper, task: str) -> str:
    """The figure and a line for each seam; nothing where no skills were exchanged.

    The table is of the first of `entry.pairs`: what the first arm's skills add, in the place of the second's.
    """
    if entry.exchanged is None:
        return ""
    found = exchange_effects(read_table(entry.exchanged))
    lines = []
    for subtask, rows in found.groupby("subtask"):
        by_effect = rows.set_index("effect")
        line = [f"skill {subtask} to skill {int(str(subtask)) + 1}", f"{by_effect['seeds'].iloc[0]:.0f}"]
        for effect in WORDS:
            row = by_effect.loc[effect]
            value, low, high, half = (float(row[name]) for name in ("value", "low", "high", "t_half"))
            low, high = outer_ends(value, low, high, half)
            line += [signed_interval(value, low, high), str(row["verdict"])]
        lines.append(line)
    header = ["seam", "seeds", *(each for said in WORDS.values() for each in (f"{said} [95%]", "verdict"))]
    first, second = (arm_label(paper, arm) for arm in entry.pairs[0])
    return f"{picture(SHOWN.format(first=first, second=second), _file(entry, task))}\n{table(header, lines)}"


def draw_exchanged(entry: Entry, task: str, figures: Path) -> list[Path]:
    """Writes the figure that `exchanged` shows, if it shows one."""
    if entry.exchanged is None:
        return []
    rows = read_table(entry.exchanged)
    figure = effects_figure(exchange_effects(rows), effects_of_seeds(rows), WORDS)
    return [save_figure(figure, figures / f"{_file(entry, task)}.png")]


def _file(entry: Entry, task: str) -> str:
    return f"{entry.prefix}{task}_exchanged"
