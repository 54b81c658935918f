"""Reads pieces of furniture from `data/*.yaml`; an error names the file, the field, what was got and what is valid."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import yaml

from tstar_envs.furniture.schema import (
    Box,
    Connector,
    Furniture,
    FurnitureError,
    Grasp,
    Part,
    Step,
    did_you_mean,
)

DATA = Path(__file__).parent / "data"
_MISSING: Any = object()


def names() -> tuple[str, ...]:
    """Returns the names that `load` knows."""
    return tuple(sorted(path.stem for path in DATA.glob("*.yaml")))


@functools.cache
def load(name: str) -> Furniture:
    """Returns the piece of furniture called `name`.

    Raises:
        FurnitureError: no file of that name, or a field of it is wrong.
    """
    if name not in names():
        raise FurnitureError(f"no furniture is called {name!r}: {did_you_mean(name, names())}")
    return read(DATA / f"{name}.yaml")


def read(path: Path) -> Furniture:
    """Reads and checks one furniture file (its schema: `data/table_lack.yaml`, with comments)."""
    text = path.read_text()
    try:
        _refuse_duplicates(yaml.compose(text, yaml.SafeLoader), "")
        return _furniture(Fields(yaml.safe_load(text), ""), path.stem)
    except (FurnitureError, yaml.YAMLError) as error:
        raise FurnitureError(f"{path.name}: {error}") from None


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

    def number(self, key: str, default: Any = _MISSING, positive: bool = False) -> float:
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise FurnitureError(f"{self.at(key)}: got {_short(value)}, expected a finite number")
        if positive and value <= 0:
            raise FurnitureError(f"{self.at(key)}: got {value}, expected a positive number")
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


def _furniture(fields: Fields, name: str) -> Furniture:
    parts = tuple(_part(part, child) for part, child in fields.children("parts"))
    steps = tuple(_step(child) for _, child in fields.children("steps"))
    z_finedist = fields.number("z_finedist", positive=True)
    pairs = fields.name_lists("no_contact")
    stiff = [
        None if fields.get(key, None) is None else fields.number(key)
        for key in ("contact_impedance", "weld_impedance")
    ]
    fields.finish()
    return Furniture(name, parts, steps, z_finedist, pairs, *stiff)


def _part(name: str, fields: Fields) -> Part:
    part = Part(
        name=name,
        initial_pose=fields.pose("initial_pose"),
        boxes=tuple(_box(child) for _, child in fields.children("boxes")),
        density=fields.number("density", positive=True),
        connectors=tuple(_connector(key, name, child) for key, child in fields.children("connectors", {})),
        grasps=tuple(_grasp(child) for _, child in fields.children("grasps", [])),
    )
    fields.finish()
    if not part.boxes:
        raise FurnitureError(f"{fields.at('boxes')}: got none, a part needs at least one")
    return part


def _box(fields: Fields) -> Box:
    size = fields.numbers("size", 3)
    if min(size) <= 0:
        raise FurnitureError(f"{fields.at('size')}: got {list(size)}, expected three positive half-sizes")
    box = Box(size, fields.numbers("pos", 3, default=(0.0, 0.0, 0.0)), fields.quat("quat"))
    fields.finish()
    return box


def _connector(name: str, part: str, fields: Fields) -> Connector:
    angles = tuple(
        math.radians(degrees) for degrees in fields.numbers("allowed_degrees", None, default=(0.0,))
    )
    connector = Connector(
        name,
        part,
        fields.numbers("pos", 3),
        fields.text("kind"),
        fields.text("mates_with"),
        fields.quat("quat"),
        angles,
    )
    fields.finish()
    return connector


def _grasp(fields: Fields) -> Grasp:
    """The two finger targets become the point between them and the axis from the left to the right one."""
    left, right = fields.numbers("left", 3), fields.numbers("right", 3)
    fields.finish()
    length = math.dist(left, right)
    if length < 1e-6:
        raise FurnitureError(f"{fields.where}: left and right are both {list(left)}, expected two points")
    point = tuple((a + b) / 2 for a, b in zip(left, right, strict=True))
    axis = tuple((b - a) / length for a, b in zip(left, right, strict=True))
    return Grasp(point, axis)  # pyright: ignore[reportArgumentType]


def _step(fields: Fields) -> Step:
    step = Step(
        moving_part=fields.text("moving_part"),
        target_part=fields.text("target_part"),
        moving_connector=fields.text("moving_connector"),
        target_connector=fields.text("target_connector"),
        angle=math.radians(fields.number("degrees")),
        waypoint=fields.numbers("waypoint", 3),
        grasp_index=fields.index("grasp", 0),
        grip_angle=fields.numbers("grip_angle", 3, default=(0.0, 0.0, -1.0)),
    )
    fields.finish()
    return step


def _refuse_duplicates(node: yaml.Node | None, where: str) -> None:
    """Refuses a name that stands twice in a mapping: YAML's reader would keep the last and drop the others."""
    if isinstance(node, yaml.SequenceNode):
        for i, child in enumerate(node.value):
            _refuse_duplicates(child, f"{where}[{i}]")
    elif isinstance(node, yaml.MappingNode):
        seen = set()
        for key, child in node.value:
            at = f"{where}.{key.value}" if where else str(key.value)
            if key.value in seen:
                raise FurnitureError(f"{at}: stands twice, again in line {key.start_mark.line + 1}")
            seen.add(key.value)
            _refuse_duplicates(child, at)


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
