"""Fields of a furniture file: each is read with its type and bounds; an error names where it stands."""

from __future__ import annotations

import math
from typing import Any

import yaml

from tstar_envs.furniture.errors import FurnitureError, did_you_mean

_MISSING: Any = object()
MAX_LENGTH = 2.0
"""m: nothing further away or larger can be reached, or is furniture."""
MIN_SIZE = 1e-4
"""m: the least half-size or radius."""


class Fields:
    """A mapping of the file that knows where it stands, and refuses what is missing, misspelt or of another type."""

    def __init__(self, data: Any, where: str):
        if not isinstance(data, dict):
            raise FurnitureError(f"{where or 'the file'}: got {_short(data)}, expected a mapping")
        self.data, self.where, self.known = data, where, set()

    def at(self, key: str) -> str:
        return f"{self.where}.{key}" if self.where else key

    def get(self, key: str, default: Any = _MISSING) -> Any:
        self.known.add(key)
        value = self.data.get(key, default)
        if value is _MISSING:
            raise FurnitureError(f"{self.at(key)}: is missing")
        return value

    def number(
        self, key: str, default: Any = _MISSING, positive: bool = False, least: float = -math.inf,
        most: float = math.inf,
    ) -> float:  # fmt: skip
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected a finite number")
        if positive and value <= 0:
            raise FurnitureError(f"{self.at(key)}: got {value}, expected a positive number")
        if not least <= value <= most:
            valid = f"from {least:g} to {most:g}" if math.isfinite(least) else f"of at most {most:g}"
            raise FurnitureError(f"{self.at(key)}: got {value:g}, expected a number {valid}")
        return float(value)

    def index(self, key: str, default: int) -> int:
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected a whole number from 0")
        return value

    def text(self, key: str) -> str:
        value = self.get(key)
        if not isinstance(value, str) or not value:
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected a name")
        return value

    def numbers(self, key: str, count: int | None, default: Any = _MISSING) -> Any:
        value = self.get(key, default)
        expected = f"a list of {count} numbers" if count else "a list of numbers"
        if not isinstance(value, (list, tuple)) or (len(value) != count if count else not value):
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected {expected}")
        return tuple(Fields({key: item}, self.where).number(key) for item in value)

    def lengths(self, key: str, count: int, default: Any = _MISSING) -> Any:
        """Returns lengths or positions in m, none of them further than `MAX_LENGTH`."""
        value = self.numbers(key, count, default)
        if max(map(abs, value)) > MAX_LENGTH:
            raise FurnitureError(
                f"{self.at(key)}: got {_short(list(value))}, expected lengths in m, none beyond {MAX_LENGTH:g}"
            )
        return value

    def sizes(self, key: str, count: int) -> Any:
        """Returns half-sizes or a radius in m, between `MIN_SIZE` and `MAX_LENGTH`; `count` 1 is a plain number."""
        value = self.numbers(key, count) if count > 1 else (self.number(key),)
        if min(value) <= 0 and count > 1:
            raise FurnitureError(f"{self.at(key)}: got {list(value)}, expected three positive half-sizes")
        if min(value) < MIN_SIZE or max(value) > MAX_LENGTH:
            got = list(value) if count > 1 else value[0]
            raise FurnitureError(
                f"{self.at(key)}: got {got}, expected sizes in m from {MIN_SIZE:g} to {MAX_LENGTH:g}"
            )
        return value

    def direction(self, key: str, default: Any) -> Any:
        """Returns a unit vector; one within 2% of unit length is normalised, another refused."""
        value = self.numbers(key, 3, default)
        length = math.hypot(*value)
        if abs(length - 1) > 0.02:
            raise FurnitureError(
                f"{self.at(key)}: got {list(value)} of length {length:.3f}, expected length 1"
            )
        return value if math.isclose(length, 1.0, abs_tol=1e-6) else tuple(x / length for x in value)

    def choice(self, key: str, valid: tuple[str, ...]) -> str:
        """Returns one of the words of `valid`, the first where the field is left out."""
        value = self.get(key, valid[0])
        if value not in valid:
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, {did_you_mean(str(value), valid)}")
        return value

    def name_lists(self, key: str) -> Any:
        """Returns a list of lists of names as tuples; none where the field is left out."""
        value = self.get(key, [])
        rows = value if isinstance(value, list) else [value]
        if not all(isinstance(row, list) and all(isinstance(name, str) for name in row) for row in rows):
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected a list of lists of names")
        return tuple(tuple(row) for row in rows)

    def quat(self, key: str) -> Any:
        return _unit_quat(self.numbers(key, 4, default=(1.0, 0.0, 0.0, 0.0)), self.at(key))

    def pose(self, key: str) -> Any:
        value = self.numbers(key, 7)
        Fields({key: value[:3]}, self.where).lengths(key, 3)
        return value[:3] + _unit_quat(value[3:], self.at(key))

    def children(self, key: str, default: Any = _MISSING) -> list[tuple[str, Fields]]:
        """Returns (name, fields) of a mapping of mappings, or (index, fields) of a list of them."""
        value = self.get(key, default)
        if isinstance(value, dict):
            for name in value:
                if not isinstance(name, str):
                    raise FurnitureError(f"{self.at(key)}: got {_short(name)}, expected a name")
            return [(name, Fields(item, f"{self.at(key)}.{name}")) for name, item in value.items()]
        if isinstance(value, list):
            return [(str(i), Fields(item, f"{self.at(key)}[{i}]")) for i, item in enumerate(value)]
        raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected a list or a mapping")

    def finish(self) -> None:
        """Refuses fields that nobody asked for."""
        for key in self.data:
            if key not in self.known:
                raise FurnitureError(
                    f"{self.at(str(key))}: unknown field, {did_you_mean(str(key), self.known)}"
                )


def refuse_duplicates(node: yaml.Node | None, where: str) -> None:
    """Refuses a name that stands twice in a mapping: YAML's reader would keep the last and drop the others."""
    if isinstance(node, yaml.SequenceNode):
        for i, child in enumerate(node.value):
            refuse_duplicates(child, f"{where}[{i}]")
    elif isinstance(node, yaml.MappingNode):
        seen = set()
        for key, child in node.value:
            at = f"{where}.{key.value}" if where else str(key.value)
            if key.value in seen:
                raise FurnitureError(f"{at}: stands twice, again in line {key.start_mark.line + 1}")
            seen.add(key.value)
            refuse_duplicates(child, at)


def _unit_quat(quat: tuple[float, ...], where: str) -> tuple[float, ...]:
    """Files carry rounded figures: a quaternion within 2% of unit length is normalised, another refused."""
    norm = math.hypot(*quat)
    if abs(norm - 1) > 0.02:
        raise FurnitureError(
            f"{where}: got quaternion {list(quat)} of length {norm:.3f}, expected (w, x, y, z) of 1"
        )
    return tuple(x / norm for x in quat)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
