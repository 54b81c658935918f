"""Learning curves of every system of a task, all seeds in one PNG, and the table of evaluations on screen.

python recipes/plot.py task=table_lack
"""

from pathlib import Path

import pandas as pd
from omegaconf import DictConfig

from tstar_rl.analysis import evaluation_table, learning_curves, read_evaluations, read_metrics, save_figure
from tstar_rl.checks import MissingFileError
from tstar_rl.config.load import recipe


@recipe("plot")
def main(config: DictConfig) -> None:
    """Draws and prints."""
    task = config.task.name
    metrics, evaluations = (_of(task, read(config.results_dir)) for read in (read_metrics, read_evaluations))
    if metrics.empty:
        raise MissingFileError(f"no metrics.csv below {config.results_dir}/{task}: train something first")
    for name, rows in metrics.groupby("recipe"):
        try:
            figure = learning_curves(rows)
        except ValueError as nothing:  # behaviour cloning has no episodes
            print(f"no curves of {name}: {nothing}")
            continue
        print(save_figure(figure, Path(config.results_dir) / task / str(name) / "curves.png"))
    table = pd.DataFrame() if evaluations.empty else evaluation_table(evaluations)
    if not table.empty:  # as it is where a skill alone was evaluated, or the script
        print(table.round(3).to_string())


def _of(task: str, table: pd.DataFrame) -> pd.DataFrame:
    return table if table.empty else table[table.task == task]


if __name__ == "__main__":
    main()
