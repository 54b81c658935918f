"""Figures of results. Each function returns a `matplotlib.figure.Figure`; none touches pyplot or its backend."""

from tstar_rl.analysis.figures.arms import ablation_figure, arms_figure, differences_figure
from tstar_rl.analysis.figures.costs import cost_figure, steps_of_arms
from tstar_rl.analysis.figures.curves import ablation_curves, learning_curves, running_means, seed_curves
from tstar_rl.analysis.figures.headline import DrawnDifference, headline_figure
from tstar_rl.analysis.figures.panels import save_figure
from tstar_rl.analysis.figures.rise import rise_figure
from tstar_rl.analysis.figures.seams import effects_figure, exchanged_figure
from tstar_rl.analysis.figures.sides import sides_figure
from tstar_rl.analysis.figures.signals import signals_figure
from tstar_rl.analysis.figures.states import hand_over_matrix, reliability_figure, terminal_state_plane
from tstar_rl.analysis.figures.tasks import tasks_figure

__all__ = [
    "DrawnDifference",
    "ablation_figure",
    "ablation_curves",
    "arms_figure",
    "cost_figure",
    "differences_figure",
    "effects_figure",
    "exchanged_figure",
    "hand_over_matrix",
    "headline_figure",
    "learning_curves",
    "reliability_figure",
    "rise_figure",
    "running_means",
    "save_figure",
    "seed_curves",
    "sides_figure",
    "signals_figure",
    "steps_of_arms",
    "tasks_figure",
    "terminal_state_plane",
]
