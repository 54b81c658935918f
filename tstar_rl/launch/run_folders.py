"""The runs that a config is of: where they lie, which of them an evaluation evaluates, and what they began with."""

import math
from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.ranges import chain_length
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import (
    FINISHED,
    SKILLS_TOOK,
    SPENT,
    is_untrained,
    run_path,
    same_spent,
    spent_by,
    spent_by_skills,
)

__all__ = [
    "begun_with",
    "check_skills_stay",
    "evaluated_runs",
    "of_an_earlier_training",
    "run_folder",
    "skills_took",
]


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


def skills_took(config: DictConfig, results: Path, links: int) -> dict[str, float]:
    """What the training of the skills took that a chain began with: as its own noted in `results`.

    Of an older chain, which noted nothing, it is what the runs of such skills say now.
    """
    noted = read_config(results).get(SKILLS_TOOK)
    return dict(noted) if noted else _skills_take(config, begun_with(results, config)[0], links)


def check_skills_stay(config: DictConfig, results: Path, links: int) -> None:
    """Refuses skills that were trained on, or anew, since the chain whose results these are began with them.

    Raises:
        CheckpointMismatchError: with the steps of both.
    """
    skills, _ = begun_with(results, config)
    then, now = skills_took(config, results, links), _skills_take(config, skills, links)
    if not any(map(math.isnan, (*then.values(), *now.values()))) and not same_spent(then, now):
        raise CheckpointMismatchError(
            f"the chain of {results} began with skills of {skills} that took {then['env_steps']:,.0f} steps in "
            f"{then['minutes']:.3f} minutes; those that are there now took {now['env_steps']:,.0f} in "
            f"{now['minutes']:.3f}, so they are others"
        )


def _skills_take(config: DictConfig, skills: str, links: int) -> dict[str, float]:
    return spent_by_skills(config.runs_dir, config.task.name, skills, config.seed, links)


def of_an_earlier_training(table: Path, config: DictConfig) -> bool:
    """Whether a table of evaluations that is there is of a training before the one that is there.

    It is where a run has ended after the table was written, unless its rows say that they took what that run took: a
    copy of the folders may have other times.
    """
    runs = evaluated_runs(config)
    ends = [run / FINISHED for run in runs]
    if not any(end.is_file() and end.stat().st_mtime_ns > table.stat().st_mtime_ns for end in ends):
        return False
    rows, own = read_table(table), spent_by(runs)
    skills = skills_took(config, table.parent, chain_length(config))
    ways = [own, {name: own[name] + skills[name] for name in SPENT}]  # of one policy, of a chain
    said = [dict(row) for row in rows.reindex(columns=list(SPENT)).to_dict("records")]
    return not said or not all(any(same_spent(row, way) for way in ways) for row in said)
