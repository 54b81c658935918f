"""Where a skill ends while it is fine-tuned: the paper's Figure 4, with a number for how far the states spread.

Reads the terminal_states.csv that chains log: one row a success, with the poses of all parts.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.seams.one_sided import one_sided

__all__ = ["add_plane", "pose_columns", "read_terminal_states", "spread"]

THIRDS = 3
Array = NDArray[np.floating]


def pose_columns(table: pd.DataFrame) -> list[str]:
    """The columns that hold poses, in their order."""
    names = [str(name) for name in table if str(name).startswith("pose_")]
    return sorted(names, key=lambda name: int(name.removeprefix("pose_")))


def read_terminal_states(root: str | Path, task: str, systems: Iterable[str]) -> pd.DataFrame:
    """Every terminal_states.csv of a task's systems, with system, seed, and the progress of training in [0, 1] added.

    Training counts from the first to the last rollout that was logged, in each run.

    Raises:
        MissingFileError: for systems that have none.
    """
    root, frames = Path(root) / task, []
    files = {system: sorted((root / system).glob("seed*/terminal_states.csv")) for system in systems}
    if without := [system for system, found in files.items() if not found]:
        raise MissingFileError(
            f"no terminal_states.csv of {', '.join(without)} below {root}: train them first (recipes/<system>.py), "
            "with chain.logged_states above 0 and a chain.logged_skill that the chain has (2, the third, by default)"
        )
    for system, found in files.items():
        for file in found:
            rows = read_table(file)
            steps = rows["env_steps"]
            progress = (steps - steps.min()) / max(steps.max() - steps.min(), 1)
            seed = int(file.parent.name.removeprefix("seed"))
            frames.append(rows.assign(system=system, seed=seed, progress=progress))
    return pd.concat(frames, ignore_index=True)


def principal_plane(poses: Array) -> tuple[Array, Array]:
    """The first two principal components of poses (n, D): coordinates (n, 2), and their shares of the variance (2,).

    The sign of each component is such that its largest weight is positive.
    """
    centred = poses - poses.mean(0)
    _, singular, axes = np.linalg.svd(centred, full_matrices=False)
    largest = np.abs(axes).argmax(1)
    axes = axes * np.sign(axes[np.arange(len(axes)), largest])[:, None]
    variance = singular**2
    return centred @ axes[:2].T, (variance / max(variance.sum(), 1e-30))[:2]


def add_plane(table: pd.DataFrame) -> tuple[pd.DataFrame, list[float]]:
    """The table with quaternions one-sided and columns x, y of one basis for all its rows; shares of the variance.

    Raises:
        InvalidValueError: for fewer than three states.
    """
    if len(table) < 3:
        raise InvalidValueError(f"a plane through terminal states needs at least 3 of them, got {len(table)}")
    columns = pose_columns(table)
    poses = one_sided(table[columns].to_numpy(dtype=np.float64))
    plane, shares = principal_plane(poses)
    table = table.assign(**dict(zip(columns, poses.T, strict=True)))
    return table.assign(x=plane[:, 0], y=plane[:, 1]), shares.tolist()


def _trace(poses: Array) -> float:
    """Trace of the covariance of rows (n, D); nan for fewer than two."""
    return float(poses.var(0, ddof=1).sum()) if len(poses) > 1 else float("nan")


def spread(table: pd.DataFrame) -> pd.DataFrame:
    """How far the states of each system and seed spread in each third of its training.

    A third is a third of the rollouts that had a success. `spread` is the trace of the covariance of all poses
    (positions in m, quaternions without unit), `spread_position` that of the positions, m^2.

    Args:
        table: from `add_plane`.
    """
    columns, lines = pose_columns(table), []
    positions = [name for index, name in enumerate(columns) if index % 7 < 3]
    for (system, seed, skill), rows in table.groupby(["system", "seed", "skill"], sort=False):
        steps = np.array(sorted(rows["env_steps"].unique()))
        for third, part in enumerate(np.array_split(steps, THIRDS)):
            within = rows[rows["env_steps"].isin(part.tolist())]
            traces = [_trace(within[names].to_numpy(dtype=np.float64)) for names in (columns, positions)]
            ends = (int(part[0]), int(part[-1])) if len(part) else (0, 0)
            lines.append(
                {"system": system, "seed": seed, "skill": skill, "third": third + 1}
                | {"env_steps_from": ends[0], "env_steps_to": ends[1], "states": len(within)}
                | {"spread": traces[0], "spread_position": traces[1]}
            )
    return pd.DataFrame(lines)
