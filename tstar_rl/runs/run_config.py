"""The config.yaml in the folder of a run's results: its values, what they ran on, and the commit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tstar_rl.checks import UserError
from tstar_rl.runs.files import replacing, turn_to_write
from tstar_rl.runs.versions import UNKNOWN, own_script, versions

__all__ = [
    "MEASURED_ON",
    "DamagedConfigError",
    "note_evaluation",
    "note_resumed",
    "note_section",
    "read_config",
    "restore_config",
    "write_config",
]


class DamagedConfigError(UserError, ValueError):
    """A run's config.yaml is not as it was written."""


MEASURED_ON = ("device", "physics")
"""What another evaluation may differ in from the training that it is of."""
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, where it is there, reads ten times faster


def read_config(folder: Path) -> dict[str, Any]:
    """The values in a run's config.yaml; none where it has none.

    Raises:
        DamagedConfigError: if the file is empty, cut off or no YAML; it is named.
    """
    file = folder / "config.yaml"
    if not file.is_file():
        return {}
    try:
        text = file.read_text()
        found = yaml.load(text, LOADER)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise DamagedConfigError(_damaged(file, " ".join(str(error).split()))) from error
    if not isinstance(found, dict) or not text.endswith("\n"):
        raise DamagedConfigError(_damaged(file, "it is empty or cut off"))
    versions_of = found.get("versions")
    if not isinstance(versions_of, dict) or "commit" not in versions_of:  # the last that every run writes
        raise DamagedConfigError(_damaged(file, "it lacks versions.commit, so it is cut off"))
    return found


def _damaged(file: Path, why: str) -> str:
    return (
        f"{file} is damaged ({why}): put it back from a copy, or delete the run's results and make them again"
    )


def write_config(folder: Path, config: Mapping[str, Any]) -> None:
    """Writes config.yaml: plain values, the versions of what they ran on, and the commit.

    A program that lies outside of the clone, of which the commit says nothing, is named with its digest.
    """
    script = own_script()
    told = {} if script is None else {"script": script}
    with turn_to_write(folder):
        _replace(folder, {**config, **told, "versions": versions()})


def restore_config(folder: Path, config: Mapping[str, Any]) -> None:
    """Writes the config.yaml of a run that has begun and whose file is lost: what it began with is not known."""
    with turn_to_write(folder):
        _replace(folder, {**config, "versions": {"commit": UNKNOWN}})


def note_resumed(folder: Path, env_steps: int) -> None:
    """Adds to config.yaml that a run went on with other versions, or at another commit, than it began with.

    Args:
        folder: of the run's results.
        env_steps: after which it went on.
    """
    _note_later(folder, {"what": "resumed", "env_steps": env_steps})


def note_section(folder: Path, name: str, values: Mapping[str, Any]) -> None:
    """Replaces a section of config.yaml, of which a resumed run may have other values than those it began with."""
    with turn_to_write(folder):
        _replace(folder, {**read_config(folder), name: dict(values)})


def note_evaluation(folder: Path, config: Mapping[str, Any], rows_stay: bool = False) -> None:
    """Writes an evaluation's config.yaml, unless the folder has that of a training, which stays.

    `evaluation_only: true` in it tells the two apart. It is for what has no training of its own: skills chained as they
    are, the script. To a config that stays it adds that it was evaluated with other versions, at another commit, on
    another device or by another simulator, if so.

    Args:
        folder: of the evaluation's results.
        config: plain values.
        rows_stay: whether the table keeps rows of an evaluation before. The versions that these came from stay, too.
    """
    with turn_to_write(folder):  # another evaluation, or a training, may begin here too
        before = read_config(folder)
        if not before or before.get("evaluation_only"):
            kept = {name: before[name] for name in ("versions", "later") if rows_stay and name in before}
            _replace(folder, {**config, "evaluation_only": True, "versions": versions(), **kept})
            if not kept:
                return
    known = [name for name in MEASURED_ON if name in before and name in config]
    other = {name: config[name] for name in known if config[name] != before[name]}
    _note_later(folder, {"what": "evaluated", **other}, always=bool(other))


def _note_later(folder: Path, line: dict[str, Any], always: bool = False) -> None:
    """Adds a line to `later` in config.yaml, once, if the versions of today are not those that the run began with.

    Args:
        folder: of the run's results.
        line: what is noted, beside the versions.
        always: whether the versions do not matter.
    """
    with turn_to_write(folder):
        kept, now = read_config(folder), versions()
        later, line = kept.get("later", []), {**line, "versions": now}
        if (always or kept.get("versions") != now) and line not in later:
            _replace(folder, {**kept, "later": [*later, line]})


def _replace(folder: Path, values: Mapping[str, Any]) -> None:
    with replacing(folder / "config.yaml") as partial:
        partial.write_text(yaml.safe_dump(values, sort_keys=False))
