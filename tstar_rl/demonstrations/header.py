"""The header of a file of demonstrations: what they are of, as JSON. An error names file, field and what is valid."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from tstar_rl.checks import UserError, did_you_mean

__all__ = ["FORMAT_VERSION", "HEADER", "KINDS", "DemonstrationError", "read_header", "unknown_setting"]

FORMAT_VERSION = 1
KINDS = ("plain", "noisy")
HEADER = ("task", "subtask", "kind", "arguments")
"""What the header has beside its version."""


class DemonstrationError(UserError, ValueError):
    """A file of demonstrations is not what it should be; the message names file and field."""


def read_header(path: str | Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """The header (`HEADER`) among the arrays of a file, checked.

    Raises:
        DemonstrationError: names the field that is wrong.
    """
    try:
        header = json.loads(str(arrays["header"]))
    except (KeyError, json.JSONDecodeError) as error:
        raise DemonstrationError(f"{path}: field header is missing or not JSON") from error
    if not isinstance(header, dict):
        raise DemonstrationError(
            f"{path}: field header is {header!r}, should be a mapping of {', '.join(HEADER)}"
        )
    for name in ("format_version", *HEADER):
        if name not in header:
            raise DemonstrationError(f"{path}: field {name} is missing from the header")
    if header["format_version"] != FORMAT_VERSION:
        raise DemonstrationError(
            f"{path}: field format_version is {header['format_version']}; this code reads {FORMAT_VERSION}"
        )
    del header["format_version"]
    if unknown := sorted({*header} - {*HEADER}):
        raise DemonstrationError(
            f"{path}: field header has {', '.join(unknown)}; valid: format_version, {', '.join(HEADER)}"
        )
    _check_header(path, **header)
    return header


def unknown_setting(names: Iterable[str]) -> str:
    """What to say of the first of `names` that is no setting of the environment; empty where all are."""
    if not (names := list(names)):
        return ""
    from tstar_rl.env.task_tables import DEFAULT_SETTINGS

    for name in names:
        if name not in DEFAULT_SETTINGS:
            hint = did_you_mean(name, DEFAULT_SETTINGS)
            return f"{name!r}; valid settings: {', '.join(DEFAULT_SETTINGS)}{hint}"
    return ""


def _check_header(path: str | Path, task: Any, subtask: Any, kind: Any, arguments: Any) -> None:
    if not isinstance(task, str) or not task:
        raise DemonstrationError(
            f"{path}: field task is {task!r}, should be the name of a piece of furniture"
        )
    counted = isinstance(subtask, int) and not isinstance(subtask, bool) and subtask >= 0
    if subtask is not None and not counted:
        raise DemonstrationError(f"{path}: field subtask is {subtask!r}, should be null (all) or 0, 1, ...")
    if kind not in KINDS:
        raise DemonstrationError(f"{path}: field kind is {kind!r}; valid: {', '.join(KINDS)}")
    if not isinstance(arguments, dict):
        raise DemonstrationError(
            f"{path}: field arguments is {arguments!r}, should be a mapping of the environment's settings"
        )
    for name, value in (("task", task), ("subtask", subtask)):
        if (found := arguments.get(name, value)) != value:
            raise DemonstrationError(
                f"{path}: field arguments.{name} is {found!r}, but field {name} is {value!r}"
            )
    if told := unknown_setting(name for name in arguments if name not in ("task", "subtask")):
        raise DemonstrationError(f"{path}: field arguments has {told}")
