"""The paper's Figure 4: where the third skill ends while the chain is fine-tuned, T-STAR and Policy Sequencing.

    python recipes/terminal_states.py task=table_lack

Principal components of the parts' poses, one basis for all, coloured by the progress of training, and the trace of
the covariance in each third of it: <results_dir>/<task>/terminal_states.png and terminal_states_spread.csv.
"""

from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.analysis import add_plane, read_terminal_states, save_figure, spread, terminal_state_plane
from tstar_rl.config.load import recipe
from tstar_rl.runs.csv_tables import write_table


@recipe("terminal_states", systems=tuple[str, ...])
def main(config: DictConfig) -> None:
    """Reads, draws and prints."""
    table = read_terminal_states(config.results_dir, config.task.name, config.systems)
    table, shares = add_plane(table)
    place = Path(config.results_dir) / config.task.name
    numbers = spread(table)
    write_table(place / "terminal_states_spread.csv", numbers)
    print(numbers.to_string(index=False))
    print(save_figure(terminal_state_plane(table, shares), place / "terminal_states.png"))


if __name__ == "__main__":
    main()
