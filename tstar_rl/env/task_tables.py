"""What is known of a task without a simulator: its settings, parts and subtasks."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.checks import short
from tstar_envs.furniture import library
from tstar_envs.furniture.schema import Furniture
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_rl.env.layout import observation_size

__all__ = [
    "DEFAULT_SETTINGS",
    "check_task",
    "furniture_digest",
    "is_piece",
    "joined_parts",
    "observation_dim",
    "part_names",
    "piece_digest",
    "subtask_geometry",
    "table_geometry",
]

DEFAULT_SETTINGS: dict[str, Any] = asdict(TaskSettings())
"""The settings of a task by name, where nothing is said about them."""


def check_task(name: str, subtasks: int, settings: Mapping[str, Any]) -> None:
    """Raises a ValueError for an unknown task, a wrong number of subtasks, or an unknown setting."""
    TaskSettings.from_mapping(settings)
    if (steps := len(library.load(name).steps)) != subtasks:
        raise ValueError(f"task.subtasks of {name} must be {steps}, the steps of its recipe, got {subtasks}")


def is_piece(task: str) -> bool:
    """Whether a piece of furniture of that name is known."""
    return task in library.names()


def observation_dim(task: str) -> int:
    """Numbers in an observation of a task."""
    return observation_size(len(library.load(task).parts))


def furniture_digest(task: str) -> str:
    """What tells a task's file of furniture from another one of that name; see `library.digest`."""
    return library.digest(task)


def piece_digest(piece: Furniture) -> str | None:
    """The same of a piece; None of one that is none of the library's, as one that was built in Python."""
    of_library = piece.name in library.names() and library.load(piece.name) is piece
    return furniture_digest(piece.name) if of_library else None


def part_names(task: str) -> tuple[str, ...]:
    """The parts of a task, in the order of the observation."""
    return library.load(task).part_names


def subtask_geometry(task: str, subtask: int) -> dict[str, Any]:
    """What `RelativeFeatures` needs to know of a subtask: part indices, connectors, grasp. Builds no simulator.

    Raises:
        ValueError: if the task has no such subtask.
    """
    return table_geometry(RecipeTables(library.load(task), torch.device("cpu")), subtask)


def joined_parts(task: str, links: int) -> dict[str, list[int]]:
    """Of the first subtasks the part that each moves and its target, by their places in the observation.

    Raises:
        ValueError: if the task has fewer subtasks.
    """
    steps = [subtask_geometry(task, index) for index in range(links)]
    of = {"part": "moving_part", "target": "target_part"}
    return {name: [step[which] for step in steps] for name, which in of.items()}


def table_geometry(tables: RecipeTables, subtask: int) -> dict[str, Any]:
    """What `subtask_geometry` gives, read from the tables of a task; raises what it does."""
    number = isinstance(subtask, numbers.Integral) and not isinstance(subtask, bool)
    if not number or not 0 <= subtask < tables.num_steps:
        raise ValueError(
            f"subtask of {tables.name} must be in 0..{tables.num_steps - 1}, got {short(subtask)}"
        )

    def figures(table: Tensor) -> Tensor:
        return table[subtask].float().cpu()  # a network is built there, and moved afterwards

    return {
        "moving_part": int(tables.moving[subtask]),
        "target_part": int(tables.target[subtask]),
        "moving_connector": figures(tables.moving_connector),
        "target_connector": figures(tables.target_connector),
        "grasp": torch.cat([figures(tables.grasp_point), geometry.frame_with_x(figures(tables.grasp_axis))]),
        "allowed_angles": figures(tables.allowed_angles),
    }
