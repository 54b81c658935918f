"""Who mended the seams of a fine-tuned chain: its skills exchanged, one at a time, for what they were before.

    python recipes/exchanged.py system=tstar scale=no_return seed=1
    python recipes/exchanged.py system=tstar against=policy_sequencing scale=no_return seed=1  # two chains' skills

Nothing is trained. <results_dir>/<task>/exchanged.csv has four rows for each seam: the first skill as before or after
fine-tuning, the second one too, and how often the second succeeds from where the first hands over. What the skills were
before is what the chain's training noted (skills and from_checkpoint in its config.yaml). Rows of the same chain are
replaced. exchanged.png beside it shows all chains of that checkpoint. From two seeds of a system on, what the first
skill's ends add, and what the second skill adds by how it takes over, is printed with intervals over seeds. With
`against` the skills are exchanged for those of another chain of the same seed: in exchanged_<against>.csv `before` says
those, and there is no picture.
"""

from functools import partial
from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.analysis.exchanged import exchange_effects
from tstar_rl.analysis.figures import exchanged_figure, save_figure
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.chain import skills_as_they_are
from tstar_rl.config.load import recipe
from tstar_rl.config.seams import chain_of, env_at_seam
from tstar_rl.intervals import share_columns
from tstar_rl.launch.evaluations import check_chain
from tstar_rl.launch.run_folders import begun_with, check_skills_stay, run_folder
from tstar_rl.runs.csv_tables import append_rows, check_table
from tstar_rl.runs.run_folder import is_untrained
from tstar_rl.seams.exchange import exchange_skills
from tstar_rl.seeds import evaluation_seed


@recipe("exchanged", checkpoint=str, from_checkpoint=str | None, against=str | None)
def main(config: DictConfig) -> None:
    """Measures one chain, writes and prints its table."""
    _check_what_is_exchanged(config)
    check_chain(config, config.system)
    after = chain_of(config, config.system)
    before = _before(config, len(after))
    name = "exchanged" if config.against is None else f"exchanged_{config.against.replace('/', '_')}"
    path = Path(config.results_dir) / config.task.name / f"{name}.csv"
    check_table(path)
    make = partial(env_at_seam, config, evaluation_seed(config.seed, "exchange"))
    chain = {"system": config.system, "seed": config.seed, "checkpoint": config.checkpoint}
    rows = [
        chain | each._asdict() | share_columns("success", each.taken, each.handed)
        for each in exchange_skills(before, after, make, config.evaluation.episodes)
    ]
    table = append_rows(path, rows, tuple(chain))
    print(table.round(3).to_string(index=False))
    shown = table[table["checkpoint"] == config.checkpoint]
    mine = shown[shown["system"] == config.system]
    if mine["seed"].nunique() > 1:
        print(exchange_effects(mine).round(3).to_string(index=False))
    drawn = config.against is None
    print(save_figure(exchanged_figure(shown), path.with_suffix(".png")) if drawn else path)


def _check_what_is_exchanged(config: DictConfig) -> None:
    """Refuses skills that would be exchanged for themselves, and a checkpoint of no use."""
    if config.against is not None and config.from_checkpoint is not None:
        raise InvalidValueError(
            f"from_checkpoint is of the skills that a chain began with, and against={config.against} exchanges with "
            f"another chain; got {config.from_checkpoint}"
        )
    if config.system == config.against or (config.against is None and is_untrained(config.system)):
        raise InvalidValueError(
            f"the skills of {config.system} would be exchanged for themselves: give system=<a fine-tuned chain>, or "
            "against=<another chain>"
        )


def _before(config: DictConfig, links: int) -> list[Skill]:
    """The skills that those of the chain are exchanged for: what they began as, or those of config.against."""
    if config.against is not None:
        check_chain(config, config.against)
        return chain_of(config, config.against)
    asked, results = config.from_checkpoint, run_folder(config, "results_dir")
    config.skills, config.from_checkpoint = begun_with(results, config)
    if asked not in (None, config.from_checkpoint):
        raise InvalidValueError(
            f"from_checkpoint must be null, got {asked}: the training of {config.system} noted that it began from "
            f"{config.from_checkpoint}"
        )
    check_skills_stay(config, results, links)
    return skills_as_they_are(config, config.from_checkpoint)


if __name__ == "__main__":
    main()
