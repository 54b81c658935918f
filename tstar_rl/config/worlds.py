"""Whether skills are asked for in the world that they were trained in."""

from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.config.demonstrations import other_settings
from tstar_rl.env.task_tables import furniture_digest
from tstar_rl.runs.checkpoint import read_record
from tstar_rl.runs.mismatch import FURNITURE, CheckpointMismatchError
from tstar_rl.runs.run_config import read_config

__all__ = ["check_world"]


def check_world(config: DictConfig, folder: Path, results: Path | None = None) -> None:
    """Refuses a skill of another world than config.env, but for the settings in config.demonstrations.may_differ.

    It also refuses one that was trained when the task's file of furniture said something else.

    Args:
        config: of what is to be done with it.
        folder: where it is saved, with the world that it, or its chain, was trained in. One of an older version says
            none.
        results: of the run, whose config.yaml says it then; what neither says is not compared.

    Raises:
        CheckpointMismatchError: with what differs.
    """
    saved, of_run = read_record(folder), read_config(results) if results else {}
    env, piece = (saved.get(name) or of_run.get(name) for name in ("env", FURNITURE))
    if piece not in (None, furniture_digest(config.task.name)):
        raise CheckpointMismatchError(
            f"{folder} was trained when {config.task.name}.yaml said something else: train it again (resume=false), or "
            "keep what is of the new file apart (runs_dir=... and results_dir=...)"
        )
    if env is not None and (wrong := other_settings(config, env, "env")):
        raise CheckpointMismatchError(
            f"{folder} was trained in another world: {'; '.join(wrong)}. Give the scale that it has, or what has this "
            "scale (runs_dir=... and results_dir=... keep scales apart), or name the settings in "
            "demonstrations.may_differ=[...]"
        )
