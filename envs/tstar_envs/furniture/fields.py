"""Fields of a furniture file: each is read with its type; an error names where it stands.

What the values may be, a piece checks itself when it is made: see `rules` and `schema`.
"""

from __future__ import annotations

import math
from typing import Any

import yaml

from tstar_envs.checks import short
from tstar_envs.furniture.errors import FurnitureError, did_you_mean, nearest
from tstar_envs.furniture.rules import check_lengths, check_number

_MISSING: Any = object()


class Fields:
    """A mapping of the file that knows where it stands, and refuses what is missing, misspelt or of another type."""

    def __init__(self, data: Any, where: str):
        if not isinstance(data, dict):
            raise FurnitureError(f"{where or 'the file'}: got {short(data)}, expected a mapping")
        self.data, self.where, self.known = data, where, set()

    def at(self, key: str) -> str:
        return f"{self.where}.{key}" if self.where else key

    def get(self, key: str, default: Any = _MISSING) -> Any:
        self.known.add(key)
        value = self.data.get(key, default)
        if value is _MISSING:
            near = nearest(key, [str(name) for name in self.data if name not in self.known])
            raise FurnitureError(f"{self.at(key)}: is missing" + (f"; is {near!r} meant?" if near else ""))
        return value

    def number(self, key: str, default: Any = _MISSING) -> float:
        value = self.get(key, default)
        check_number(self.at(key), value)
        return float(value)

    def index(self, key: str, default: int) -> int:
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise FurnitureError(f"{self.at(key)}: got {short(value)}, expected a whole number from 0")
        return value

    def text(self, key: str) -> str:
        value = self.get(key)
        if not isinstance(value, str) or not value:
            raise FurnitureError(f"{self.at(key)}: got {short(value)}, expected a name")
        return value

    def numbers(self, key: str, count: int | None, default: Any = _MISSING) -> Any:
        value = self.get(key, default)
        expected = f"a list of {count} numbers" if count else "a list of numbers"
        if not isinstance(value, (list, tuple)) or (len(value) != count if count else not value):
            raise FurnitureError(f"{self.at(key)}: got {short(value)}, expected {expected}")
        return tuple(Fields({key: item}, self.where).number(key) for item in value)

    def lengths(self, key: str, count: int) -> Any:
        """Returns lengths or positions in m, none of them further than `MAX_LENGTH`."""
        value = self.numbers(key, count)
        check_lengths(self.at(key), value)
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

    def name_lists(self, key: str) -> Any:
        """Returns a list of lists of names as tuples; none where the field is left out."""
        value = self.get(key, [])
        rows = value if isinstance(value, list) else [value]
        if not all(isinstance(row, list) and all(isinstance(name, str) for name in row) for row in rows):
            raise FurnitureError(f"{self.at(key)}: got {short(value)}, expected a list of lists of names")
        return tuple(tuple(row) for row in rows)

    def quat(self, key: str) -> Any:
        return _unit_quat(self.numbers(key, 4, default=(1.0, 0.0, 0.0, 0.0)), self.at(key))

    def pose(self, key: str) -> Any:
        value = self.numbers(key, 7)
        return value[:3] + _unit_quat(value[3:], self.at(key))

    def children(self, key: str, default: Any = _MISSING) -> list[tuple[str, Fields]]:
        """Returns (name, fields) of a mapping of mappings."""
        value = self.get(key, default)
        if not isinstance(value, dict):
            raise FurnitureError(f"{self.at(key)}: got {short(value)}, expected a mapping of names")
        for name in value:
            if not isinstance(name, str):
                raise FurnitureError(f"{self.at(key)}: got {short(name)}, expected a name")
        return [(name, Fields(item, f"{self.at(key)}.{name}")) for name, item in value.items()]

    def items(self, key: str, default: Any = _MISSING) -> list[Fields]:
        """Returns the fields of each mapping of a list of them."""
        value = self.get(key, default)
        if not isinstance(value, list):
            raise FurnitureError(f"{self.at(key)}: got {short(value)}, expected a list")
        return [Fields(item, f"{self.at(key)}[{i}]") for i, item in enumerate(value)]

    def finish(self) -> None:
        """Refuses fields that nobody asked for."""
        for key in self.data:
            if key not in self.known:
                raise FurnitureError(
                    f"{self.at(str(key))}: unknown field, {did_you_mean(str(key), self.known)}"
                )


def refuse_odd_names(
    node: yaml.Node | None, where: str, above: tuple[yaml.Node, ...] = (), passed: set[int] | None = None
) -> None:
    """Refuses what YAML's reader would take or stumble over.

    That is a name that stands twice in a mapping (the last would be kept), a name that is a list or a mapping, and an
    alias of what it stands in. What an alias repeats is looked at once.
    """
    if node in above:
        raise FurnitureError(f"{where or 'the file'}: is an alias of what it stands in")
    passed = set() if passed is None else passed
    if node is None or id(node) in passed:
        return
    above = (*above, node)
    if isinstance(node, yaml.SequenceNode):
        for i, child in enumerate(node.value):
            refuse_odd_names(child, f"{where}[{i}]", above, passed)
    elif isinstance(node, yaml.MappingNode):
        seen = set()
        for key, child in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise FurnitureError(
                    f"{where or 'the file'}: got a list or a mapping in line {line}, expected a name"
                )
            at = f"{where}.{key.value}" if where else str(key.value)
            if key.value in seen:
                raise FurnitureError(f"{at}: stands twice, again in line {line}")
            seen.add(key.value)
            refuse_odd_names(child, at, above, passed)
    passed.add(id(node))


def _unit_quat(quat: tuple[float, ...], where: str) -> tuple[float, ...]:
    """Files carry rounded figures: a quaternion within 2% of unit length is normalised, another refused."""
    norm = math.hypot(*quat)
    if abs(norm - 1) > 0.02:
        raise FurnitureError(
            f"{where}: got quaternion {list(quat)} of length {norm:.3f}, expected (w, x, y, z) of 1"
        )
    return tuple(x / norm for x in quat)
