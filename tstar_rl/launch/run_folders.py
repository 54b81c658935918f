"""The runs that a config is of: where they lie, which of them an evaluation evaluates, and what they began with."""

from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.ranges import chain_length
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import FINISHED, is_untrained, run_path

__all__ = ["begun_with", "ended_since", "evaluated_runs", "run_folder"]


def run_folder(config: DictConfig, root: str) -> Path:
    """Where a config's run lies below config.results_dir or config.runs_dir, whichever `root` names."""
    return run_path(config[root], config.task.name, config.system, config.seed, config.subtask)


def evaluated_runs(config: DictConfig) -> list[Path]:
    """Folders below config.runs_dir of the runs that an evaluation of config.system evaluates.

    That is one run; without fine-tuning it is the run of each skill of the chain.

    Raises:
        InvalidValueError: if one subtask of skills that are chained is asked for.
    """
    if is_untrained(config.system) and config.subtask is not None:
        raise InvalidValueError(
            f"system={config.system} is a chain, and has no subtask={config.subtask}: system={config.skills} "
            f"subtask={config.subtask} is the skill, chain.links takes the first skills of a chain"
        )
    if not is_untrained(config.system):
        return [run_folder(config, "runs_dir")]
    skills = (config.runs_dir, config.task.name, config.skills, config.seed)
    return [run_path(*skills, index) for index in range(chain_length(config))]


def begun_with(results: Path, config: DictConfig) -> tuple[str, str]:
    """The system whose skills a chain began with, and their checkpoint: as its training noted in `results`.

    Without fine-tuning, or where nothing is noted, they are those that are asked for.
    """
    found = {"skills": config.skills, "from_checkpoint": config.get("from_checkpoint") or "last"}
    noted = read_config(results)
    if not noted.get("evaluation_only"):
        found |= {name: noted[name] for name in found if name in noted}
    return found["skills"], found["from_checkpoint"]


def ended_since(table: Path, runs: Sequence[Path]) -> bool:
    """Whether one of these runs has ended after a table that is there was written: it is of an earlier training."""
    ends = [run / FINISHED for run in runs]
    return any(end.is_file() and end.stat().st_mtime_ns > table.stat().st_mtime_ns for end in ends)
