"""Whether an evaluation that is there is the one that is asked for."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from tstar_rl.config.values import plain
from tstar_rl.launch.run_folders import evaluated_runs, of_an_earlier_training, run_folder
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.runs.mismatch import FURNITURE, CheckpointMismatchError, differences
from tstar_rl.runs.run_config import MEASURED_ON, read_config
from tstar_rl.runs.run_folder import FINISHED, run_path

__all__ = ["check_chain", "check_evaluation", "is_evaluated"]


def is_evaluated(config: DictConfig, furniture: dict[str, str]) -> bool:
    """Whether a table that is there is complete, and not older than the end of any run that it is of.

    Args:
        config: of the evaluation.
        furniture: what is noted of the task's file of furniture, {FURNITURE: digest}; {}: it is not compared.
    """
    results, runs = run_folder(config, "results_dir"), evaluated_runs(config)
    check_evaluation(results, plain(config) | furniture)
    file = results / "evaluation.csv"
    if not all((run / FINISHED).is_file() for run in runs) or of_an_earlier_training(file, config):
        return False
    table, evaluation = read_table(file, ("checkpoint", "mode", "seed", "episodes")), config.evaluation
    number = evaluation.whole_episodes if config.subtask is None else evaluation.episodes
    rows = table[(table.seed == config.seed) & (table.episodes == number)]
    rows, asked = rows[rows.checkpoint.isin(list(config.checkpoints))], set(config.modes)
    left = [name for name in config.checkpoints if all((run / name).is_dir() for run in runs)]
    return asked <= set(rows["mode"]) and all(
        asked <= set(rows[rows.checkpoint == name]["mode"]) for name in left
    )


def check_evaluation(folder: Path, config: Mapping[str, Any]) -> None:
    """Refuses an evaluation that the config.yaml of `folder` would not tell of.

    That is one in another world than that of the training, or of the evaluation, that is there, or with another piece
    of that name, where both are known; and, of skills chained as they are, one of others, on another device or by
    another simulator.

    Raises:
        CheckpointMismatchError: with what differs.
    """
    saved = read_config(folder)
    if not saved:
        return
    if FURNITURE in saved and saved[FURNITURE] != config.get(FURNITURE, saved[FURNITURE]):
        raise CheckpointMismatchError(
            f"{folder} has the results of another {config['task']['name']}.yaml than there is now: give another "
            "results_dir=..., or delete them"
        )
    names = ("env", "skills", "links", *MEASURED_ON) if saved.get("evaluation_only") else ("env",)
    there, now = ({**values, "links": values.get("chain", {}).get("links")} for values in (saved, config))
    if wrong := differences(*({name: values.get(name) for name in names} for values in (there, now))):
        raise CheckpointMismatchError(
            f"{folder} has the results of something else: {'; '.join(wrong)}. Give the scale that it has, or another "
            "results_dir=..., or, of skills chained as they are, another system=no_finetuning_<name>"
        )


def check_chain(config: DictConfig, system: str) -> None:
    """Refuses a config of another world than that in which the chain of `system` was trained or evaluated.

    Raises:
        CheckpointMismatchError: with what differs.
    """
    folder = run_path(config.results_dir, config.task.name, system, config.seed)
    check_evaluation(folder, plain(config))
