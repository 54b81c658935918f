"""Arms over several tasks: every run is a dot, intervals and profiles are those of the tables."""

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tstar_rl.analysis.experiments import SEED, TaskScores
from tstar_rl.analysis.figures.panels import MARKERS, arm_line, draw_profile, panels, readable
from tstar_rl.analysis.over_tasks import arms_with
from tstar_rl.analysis.task_statistics import interquartile_interval, profile_over_tasks

__all__ = ["tasks_figure"]

DOTS = (-0.34, 0.2)
"""Where the tasks of an arm stand, from its first to its last; its row is one high, and the interval is below them."""
INTERVAL = 0.36
TICKS = (0, 0.5, 0.8, 0.9, 0.95, 0.98, 1)
BEYOND = 1.01
"""Where the stretched axis would end: progress 1 has to have a place on it."""
THRESHOLDS = BEYOND - np.geomspace(BEYOND, BEYOND - 1, 301)
"""Of a performance profile: values of progress, 0 to 1, as far apart as the stretched axis shows them."""


def _runs(axes: Axes, scores: TaskScores, tasks: Sequence[str], arms: Sequence[str]) -> None:
    """A row for each arm, in it a line of dots for each task, and below them interquartile mean and interval."""
    for place, arm in enumerate(arms):
        heights = place + np.linspace(*DOTS, len(tasks))
        for number, (task, height) in enumerate(zip(tasks, heights, strict=True)):
            means = [episodes.mean() for episodes in scores[task][arm].values()]
            style = {"color": arm_line(place)["color"], "marker": MARKERS[number % len(MARKERS)]}
            axes.plot(means, [height] * len(means), linestyle="", markersize=5, alpha=0.75, mew=0, **style)
        strata = [list(scores[task][arm].values()) for task in tasks]
        value, low, high = interquartile_interval(strata, np.random.default_rng(SEED))
        ends = np.clip([[value - low], [high - value]], 0, None)
        bar = {"fmt": "|", "color": "black", "capsize": 3, "markersize": 10, "markeredgewidth": 1.8}
        axes.errorbar(value, place + INTERVAL, xerr=ends, **bar)
        axes.axhline(place + 0.5, color="0.8", linewidth=0.8)
    axes.set_xlabel("progress of each run; interquartile mean, 95%")
    _stretch(axes)
    axes.set_ylim(len(arms) - 0.5, -0.5)
    axes.grid(False, axis="y")


def _profiles(axes: Axes, scores: TaskScores, tasks: Sequence[str], arms: Sequence[str]) -> None:
    for place, arm in enumerate(arms):
        strata = [list(scores[task][arm].values()) for task in tasks]
        profile = profile_over_tasks(strata, THRESHOLDS, np.random.default_rng(SEED))
        draw_profile(axes, place, profile, THRESHOLDS)
    axes.set(xlabel="progress above", ylabel="share of runs, mean over tasks", ylim=(-0.02, 1.02))
    _stretch(axes)


def _stretch(axes: Axes) -> None:
    """Gives progress near 1, where most runs are, as much room as the rest."""
    axes.set_xscale(
        "function", functions=(lambda x: -np.log10(np.maximum(BEYOND - x, 1e-9)), lambda y: BEYOND - 10.0**-y)
    )
    axes.set_xlim(-0.02, 1.002)
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])


def tasks_figure(
    scores: TaskScores, tasks: Sequence[str], arms: Sequence[str], labels: Mapping[str, str] | None = None
) -> Figure:
    """Progress of arms over several tasks, and the performance profile of each.

    Left: a dot is a run, that is one seed of one task; its shape is the task. Below the dots of an arm is the
    interquartile mean with its 95% stratified bootstrap interval. Right: the share of runs whose progress is above a
    value, mean over tasks, with its pointwise 95% band. The axes of progress are stretched towards 1.

    Args:
        scores: of an experiment, `Experiment.scores`.
        tasks: over which it is aggregated.
        arms: from top to bottom; each must have all of the tasks.
        labels: of arms.

    Raises:
        ValueError: if an arm lacks one of the tasks.
    """
    unfit = [arm for arm in arms if arm not in arms_with(scores, tasks)]
    if unfit:
        raise ValueError(f"arms of the figure need all of {', '.join(tasks)}; not so: {', '.join(unfit)}")
    called = [(labels or {}).get(arm, readable(arm)) for arm in arms]
    size = (11, 2.6 + len(arms) * max(0.75, 0.11 * len(tasks)))
    figure, grid = panels(1, 2, size, width_ratios=(1.2, 1))
    runs, profiles = grid[0]
    _runs(runs, scores, tasks, arms)
    runs.set_yticks(range(len(arms)), [_wrapped(name, 22) for name in called])
    _profiles(profiles, scores, tasks, arms)
    _legends(figure, tasks, called)
    return figure


def _wrapped(name: str, width: int) -> str:
    return textwrap.fill(name, width, break_on_hyphens=False)


def _legends(figure: Figure, tasks: Sequence[str], arms: Sequence[str]) -> None:
    """Above the panels shapes of the tasks, below them lines of the arms."""
    shapes = [
        Line2D([], [], color="0.35", linestyle="", marker=MARKERS[place % len(MARKERS)], label=readable(task))
        for place, task in enumerate(tasks)
    ]
    lines = [Line2D([], [], linewidth=1.8, label=name, **arm_line(place)) for place, name in enumerate(arms)]
    style = {"fontsize": 9, "frameon": False}
    figure.legend(handles=shapes, loc="outside upper center", ncols=5, handletextpad=0.1, **style)
    figure.legend(handles=lines, loc="outside lower center", ncols=2, handlelength=3.4, **style)
