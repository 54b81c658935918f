"""The figures of the page, all of them drawn from the published tables."""

from pathlib import Path

import pandas as pd

from tstar_rl.analysis.experiments import read_experiment
from tstar_rl.analysis.figures import (
    hand_over_matrix,
    running_means,
    save_figure,
    seed_curves,
    terminal_state_plane,
)
from tstar_rl.analysis.page.calibration import draw_calibration
from tstar_rl.analysis.page.choices import draw_choices
from tstar_rl.analysis.page.contents import Entry, read_contents
from tstar_rl.analysis.page.costs import draw_costs
from tstar_rl.analysis.page.exchanged import draw_exchanged
from tstar_rl.analysis.page.experiment import draw_experiment
from tstar_rl.analysis.page.markdown import Paper, picture
from tstar_rl.analysis.page.over_tasks import draw_over_tasks
from tstar_rl.analysis.page.turns import draw_turns
from tstar_rl.analysis.tables import read_hand_over, read_metrics
from tstar_rl.analysis.terminal_states import add_plane, read_terminal_states
from tstar_rl.runs.csv_tables import read_table

__all__ = ["curve_groups", "curves", "draw_page"]

WINDOW = 50
"""Rollouts over which the curves of single policies run: one has a few episodes that begin at the task's own start."""

COLUMNS = {
    "skills": {"success_rate": "seed", "phase": "seed", "episode_length": "seed"},
    "chains": {"success_rate": "skill", "trial_progress": "seed"},
    "single_policies": {"phase": "seed", "completed": "seed"},
}
CAPTIONS = {
    "skills": "Success of the skills in training, mean phase of their steps, length of episodes: a line for each seed.",
    "chains": "Fine-tuning the chains: success in training, a colour for each skill; trials, one for each seed.",
    "single_policies": (
        "Policies of the whole task in training, from its own start: mean phase of their steps, which is that "
        "of the subtask at hand and so may fall as more are completed; and subtasks completed in an episode. Running "
        f"means over {WINDOW} rollouts. Whole tasks end sooner than failures, so the first points of the second "
        "are too high."
    ),
}


def curve_groups(metrics: pd.DataFrame, task: str) -> dict[str, pd.DataFrame]:
    """What a task's runs logged: of skills, of chains, and of policies for the whole task, where there are any.

    Of a chain whose policies are not trained (`recover`, `refitted`) nothing can be drawn.
    """
    rows = metrics[(metrics["task"] == task) & (metrics["env_steps"] > 0)] if len(metrics) else metrics
    if rows.empty:
        return {}
    chained = rows["skill"].notna() if "skill" in rows else pd.Series(False, rows.index)
    whole = (rows["subtask"] == -1) & ~chained
    drawn = [name for name in ("success_rate", "trial_progress") if name in rows]
    trained = chained & rows[drawn].notna().any(axis=1) if drawn else chained & False
    groups = {"skills": rows[rows["subtask"] >= 0], "chains": rows[trained], "single_policies": rows[whole]}
    return {name: group for name, group in groups.items() if len(group)}


def curves(metrics: pd.DataFrame, task: str, prefix: str) -> str:
    """Links to the figures of `curve_groups`."""
    return "\n".join(
        picture(CAPTIONS[name], f"{prefix}{task}_{name}") for name in curve_groups(metrics, task)
    )


def draw_page(root: Path, paper: Paper, figures: Path) -> list[Path]:
    """Draws every figure that the page shows.

    Args:
        root: of the published results.
        paper: docs/paper_results.yaml.
        figures: folder of the PNG files.
    """
    contents = read_contents(root)
    found = []
    if contents.headline:
        found.append(save_figure(contents.headline.figure(), figures / "headline.png"))
    for entry in contents.experiments:
        if entry.kind == "ablations":
            continue
        if entry.kind == "experiment":
            experiment, named = read_experiment(entry.folder, entry.commits == "one"), entry.named(paper)
            found += draw_over_tasks(experiment, named, entry, figures)
            found += draw_experiment(experiment, named, entry, figures)
            metrics = read_metrics(entry.folder)
            for task in filter(entry.has_section, experiment.tasks):
                found += draw_costs(experiment, metrics, named, entry, task, figures)
                found += draw_turns(experiment, metrics, named, task, entry.prefix, figures)
                found += draw_exchanged(entry, task, figures)
                found += draw_choices(experiment, named, entry, task, figures)
                found += draw_calibration(entry.folder, metrics, named, task, entry.prefix, figures)
        found += _draw_runs(entry, figures)
    return found


def _draw_runs(entry: Entry, figures: Path) -> list[Path]:
    """Curves, hand-overs and terminal states of every task."""
    metrics, handed, found = read_metrics(entry.folder), read_hand_over(entry.folder), []
    for task in filter(
        entry.has_section, sorted(each.name for each in entry.folder.iterdir() if each.is_dir())
    ):
        for name, rows in curve_groups(metrics, task).items():
            if name == "single_policies":
                rows = running_means(rows, list(COLUMNS[name]), WINDOW)
            where = rows["recipe"]
            if name == "skills":
                where = where + ", skill " + (rows["subtask"] + 1).astype(str)
            figure = seed_curves(rows.assign(panel=where), COLUMNS[name], "panel")
            found.append(save_figure(figure, figures / f"{entry.prefix}{task}_{name}.png"))
        mine = handed[(handed["task"] == task) & (handed["checkpoint"] == "last")] if len(handed) else handed
        if len(mine):
            found.append(save_figure(hand_over_matrix(mine), figures / f"{entry.prefix}{task}_hand_over.png"))
        spread = entry.folder / task / "terminal_states_spread.csv"
        if spread.is_file():
            systems = list(dict.fromkeys(read_table(spread)["system"]))
            states, shares = add_plane(read_terminal_states(entry.folder, task, systems))
            plane = terminal_state_plane(states, shares)
            found.append(save_figure(plane, figures / f"{entry.prefix}{task}_terminal_states.png"))
    return found
