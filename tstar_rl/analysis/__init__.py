"""Reading results: tables, statistics, figures and the page of results. Reads files alone; needs no TorchRL."""

from tstar_rl.analysis.ablation_plots import (
    ablation_bars,
    ablation_curves,
    ablation_finding,
    ablation_table,
    load_ablation,
    load_ablation_metrics,
)
from tstar_rl.analysis.plotting import evaluation_table, learning_curves, read_evaluations, read_metrics
from tstar_rl.analysis.result_plots import hand_over_matrix, seed_curves, terminal_state_plane

__all__ = [
    "ablation_bars",
    "ablation_curves",
    "ablation_finding",
    "ablation_table",
    "evaluation_table",
    "hand_over_matrix",
    "learning_curves",
    "load_ablation",
    "load_ablation_metrics",
    "read_evaluations",
    "read_metrics",
    "seed_curves",
    "terminal_state_plane",
]
