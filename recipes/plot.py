"""Learning curves of every run of a task as PNG files beside them, and the table of evaluations on screen.

python recipes/plot.py task=table_lack
"""

from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.analysis import evaluation_table, learning_curves, read_evaluations, read_metrics, save_figure
from tstar_rl.config.load import recipe


@recipe("plot")
def main(config: DictConfig) -> None:
    """Draws and prints."""
    metrics, task = read_metrics(config.results_dir), config.task.name
    if metrics.empty:
        raise SystemExit(f"no metrics.csv below {config.results_dir}: train something first")
    for name, rows in metrics[metrics.task == task].groupby("recipe"):
        try:
            figure = learning_curves(rows)
        except ValueError as nothing:  # behaviour cloning has no episodes
            print(f"no curves of {name}: {nothing}")
            continue
        print(save_figure(figure, Path(config.results_dir) / task / str(name) / "curves.png"))
    evaluations = read_evaluations(config.results_dir)
    if not evaluations.empty and (evaluations.subtask == -1).any():
        print(evaluation_table(evaluations).round(3).to_string())


if __name__ == "__main__":
    main()
