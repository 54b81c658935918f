"""Reading results: tables, statistics, figures and the page of results.

Reads files alone. Importing it loads neither torch nor TorchRL, and leaves Matplotlib's backend as it is.
"""

from tstar_rl.analysis.ablations import ablation_finding, ablation_table, load_ablation, load_ablation_metrics
from tstar_rl.analysis.differences import paired_difference
from tstar_rl.analysis.experiments import (
    Experiment,
    arm_table,
    compare_arms,
    read_experiment,
)
from tstar_rl.analysis.figures.arms import ablation_figure, arms_figure, differences_figure
from tstar_rl.analysis.figures.costs import cost_figure, steps_of_arms
from tstar_rl.analysis.figures.curves import ablation_curves, learning_curves, seed_curves
from tstar_rl.analysis.figures.panels import save_figure
from tstar_rl.analysis.figures.rise import rise_figure
from tstar_rl.analysis.figures.states import hand_over_matrix, reliability_figure, terminal_state_plane
from tstar_rl.analysis.figures.tasks import tasks_figure
from tstar_rl.analysis.gaps_of_runs import hand_over_gaps
from tstar_rl.analysis.hand_over_gap import product_of_skills
from tstar_rl.analysis.over_tasks import tasks_table
from tstar_rl.analysis.statistics import interquartile_mean, performance_profile, probability_of_improvement
from tstar_rl.analysis.tables import (
    episode_progress,
    evaluation_table,
    read_calibration,
    read_evaluations,
    read_hand_over,
    read_metrics,
)
from tstar_rl.analysis.task_statistics import (
    improvement_over_tasks,
    interquartile_interval,
    profile_over_tasks,
)
from tstar_rl.analysis.terminal_states import add_plane, read_terminal_states, spread
from tstar_rl.analysis.turns import turn_table

__all__ = [
    "Experiment",
    "ablation_figure",
    "ablation_curves",
    "ablation_finding",
    "ablation_table",
    "add_plane",
    "arm_table",
    "arms_figure",
    "compare_arms",
    "differences_figure",
    "episode_progress",
    "evaluation_table",
    "hand_over_gaps",
    "hand_over_matrix",
    "improvement_over_tasks",
    "interquartile_interval",
    "interquartile_mean",
    "learning_curves",
    "load_ablation",
    "load_ablation_metrics",
    "paired_difference",
    "performance_profile",
    "probability_of_improvement",
    "product_of_skills",
    "profile_over_tasks",
    "read_calibration",
    "read_evaluations",
    "read_experiment",
    "read_hand_over",
    "read_metrics",
    "read_terminal_states",
    "reliability_figure",
    "rise_figure",
    "steps_of_arms",
    "cost_figure",
    "save_figure",
    "seed_curves",
    "spread",
    "tasks_figure",
    "tasks_table",
    "terminal_state_plane",
    "turn_table",
]
