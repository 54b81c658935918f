"""Whether skills are asked for in the world that they were trained in."""

from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.config.demonstrations import other_settings
from tstar_rl.runs.checkpoint import read_record
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import read_config

__all__ = ["check_world"]


def check_world(config: DictConfig, folder: Path, results: Path | None = None) -> None:
    """Refuses a skill of another world than config.env, but for the settings in config.demonstrations.may_differ.

    Args:
        config: of what is to be done with it.
        folder: where it is saved, with the world that it, or its chain, was trained in. One of an older version says
            none.
        results: of the run, whose config.yaml says it then; nothing is compared where neither does.

    Raises:
        CheckpointMismatchError: with what differs.
    """
    env = read_record(folder).get("env") or (read_config(results).get("env") if results else None)
    if env is None:
        return
    if wrong := other_settings(config, env, "env"):
        raise CheckpointMismatchError(
            f"{folder} was trained in another world: {'; '.join(wrong)}. Give the scale that it has, or what has this "
            "scale (runs_dir=... and results_dir=... keep scales apart), or name the settings in "
            "demonstrations.may_differ=[...]"
        )
