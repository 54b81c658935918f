"""Each seam of some chains at a glance: what decides, how far skills move it, what that costs them, what is kept.

    for s in no_finetuning floored; do python recipes/hand_over_gap.py scale=narrow seed=0 system=$s; done
    python recipes/anatomy.py scale=narrow "systems=[no_finetuning, floored]"

Reads seams.csv and hand_over_gap.csv, which hand_over_gap.py has left in <results_dir>/<task>/, and the chains' own
metrics.csv; runs no simulation. What decides a seam is what decides it for the first system, which must fail often
enough at some seam. It writes anatomy.csv, a row for each seam, chain and seed (columns: `tstar_rl.analysis.anatomy`),
and anatomy.png. The last system less each other one is printed, with Student's interval over seeds.
"""

from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.analysis import read_metrics, save_figure
from tstar_rl.analysis.anatomy import anatomy_changes, deciding_inputs, seam_anatomy
from tstar_rl.analysis.figures.anatomy import anatomy_figure
from tstar_rl.analysis.figures.panels import readable
from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.load import recipe
from tstar_rl.runs.csv_tables import read_table, write_table


@recipe("anatomy", systems=tuple[str, ...], names=tuple[str, ...] | None, checkpoint=str)
def main(config: DictConfig) -> None:
    """Reads, draws and prints."""
    place, systems = Path(config.results_dir) / config.task.name, list(config.systems)
    names = list(config.names or map(readable, systems))
    if len(names) != len(systems):
        raise InvalidValueError(f"names must be null or one for each of systems {systems}, got {names}")
    for name in (files := ("seams", "hand_over_gap")):
        if not (place / f"{name}.csv").is_file():
            raise MissingFileError(
                f"no {place / name}.csv: recipes/hand_over_gap.py writes it, chain by chain"
            )
    seams, gaps = (read_table(place / f"{name}.csv") for name in files)
    seams, gaps = (rows[rows["checkpoint"] == config.checkpoint] for rows in (seams, gaps))
    metrics = read_metrics(config.results_dir)
    metrics = metrics if metrics.empty else metrics[metrics["task"] == config.task.name]
    table = seam_anatomy(seams, gaps, metrics, systems)
    write_table(place / "anatomy.csv", table)
    means = table.groupby(["subtask", "by", "system"], sort=False).mean(numeric_only=True)
    print(means.drop(columns="seed").round(3).to_string())
    for other in systems[:-1]:
        print(f"{systems[-1]} less {other}:")
        print(anatomy_changes(table, systems[-1], other).round(3).to_string(index=False))
    falls = deciding_inputs(seams, systems[0])
    figure = anatomy_figure(falls, table, dict(zip(systems, names, strict=True)))
    print(save_figure(figure, place / "anatomy.png"))


if __name__ == "__main__":
    main()
