"""What other libraries call an environment: its Gymnasium id and spec, its scene as XML; and back to a task."""

import copy
from collections.abc import Mapping
from typing import Any

from gymnasium.envs.registration import EnvSpec, registry

from tstar_envs.furniture import library
from tstar_envs.gymnasium_env import environment_id, register
from tstar_envs.scene import scene_xml

__all__ = ["gymnasium_id", "gymnasium_spec", "model_xml", "task_called"]


def gymnasium_id(task: str) -> str:
    """Gymnasium's id of a task, such as `tstar/<Name>-v0`."""
    return environment_id(task)


def gymnasium_spec(arguments: Mapping[str, Any]) -> EnvSpec:
    """The spec from which `gymnasium.make` builds the environment of these arguments (task, subtask, settings)."""
    register()
    spec = copy.deepcopy(registry[environment_id(arguments["task"])])
    spec.kwargs.update(arguments)
    return spec


def task_called(name: str) -> str:
    """The task of that Gymnasium id, with or without the module that registers it, or of that piece of furniture.

    Raises:
        ValueError: if there is none; the message says which are valid.
    """
    for task in library.names():
        if name.rpartition(":")[2] in (task, environment_id(task)):
            return task
    return library.load(name).name  # raises, with the names that are valid


def model_xml(task: str) -> str:
    """The scene of a task as MuJoCo's XML, for other programs; see `tstar_envs.scene.scene_xml`."""
    return scene_xml(library.load(task))
