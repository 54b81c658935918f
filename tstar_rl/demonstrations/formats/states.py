"""Full states as rows of numbers, and what stands where in a row: so a file holds them without knowing the task.

A state is a snapshot of the environment: the simulator's integration row, the weld poses and the state of the task.
All of it fits in float64 without loss: whole numbers are small, flags are 0 and 1.
"""

import json
import math
from typing import Any, NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

__all__ = ["Entry", "StateLayout"]

DTYPES = {str(dtype).removeprefix("torch."): dtype for dtype in (torch.float64, torch.int64, torch.bool)}


class Entry(NamedTuple):
    """One entry of a snapshot: its name (nested ones with a slash), the shape of one state's, and its type."""

    name: str
    shape: tuple[int, ...]
    dtype: str

    @property
    def size(self) -> int:
        return math.prod(self.shape)


class StateLayout:
    """Which entry of a snapshot stands where in a row.

    Args:
        entries: in their order in a row.

    Raises:
        ValueError: if an entry has a type that a row does not hold exactly.
    """

    def __init__(self, entries: list[Entry]) -> None:
        for entry in entries:
            if entry.dtype not in DTYPES:
                raise ValueError(
                    f"{entry.name} of a state has type {entry.dtype}; valid: {', '.join(DTYPES)}"
                )
        self.entries = entries

    @property
    def size(self) -> int:
        """Numbers D in a row."""
        return sum(entry.size for entry in self.entries)

    @classmethod
    def of(cls, snapshots: TensorDictBase) -> "StateLayout":
        """The layout of snapshots of batch [T]."""
        found = []
        for name, value in snapshots.flatten_keys("/").items():
            found.append(Entry(name, tuple(value.shape[1:]), str(value.dtype).removeprefix("torch.")))
        return cls(found)

    @classmethod
    def from_json(cls, text: str | bytes) -> "StateLayout":
        """What `to_json` wrote.

        Raises:
            ValueError: if it is no list of entries with name, shape and dtype.
        """
        try:
            listed: list[dict[str, Any]] = json.loads(text)
            entries = [
                Entry(str(one["name"]), tuple(map(int, one["shape"])), str(one["dtype"])) for one in listed
            ]
        except (TypeError, KeyError, ValueError) as error:
            raise ValueError(f"a layout of states is a list of name, shape and dtype: {error!r}") from error
        return cls(entries)

    def to_json(self) -> str:
        """A list of {"name", "shape", "dtype"}, in the order of the row."""
        return json.dumps([entry._asdict() for entry in self.entries])

    def rows(self, snapshots: TensorDictBase) -> Tensor:
        """Snapshots of batch [T] as (T, D) float64."""
        flat = snapshots.flatten_keys("/")
        columns = [flat[entry.name] for entry in self.entries]
        return torch.cat([column.reshape(len(column), -1).to(torch.float64) for column in columns], dim=-1)

    def snapshots(self, rows: Tensor) -> TensorDict:
        """The inverse of `rows`: (T, D) float64 to snapshots of batch [T].

        Raises:
            ValueError: if a row does not have D numbers.
        """
        if rows.shape[-1] != self.size:
            raise ValueError(f"a state has {rows.shape[-1]} numbers, but its layout has {self.size}")
        found: dict[str, Tensor] = {}
        for entry, column in zip(
            self.entries, rows.split([e.size for e in self.entries], dim=-1), strict=True
        ):
            value = column.reshape(len(rows), *entry.shape)
            found[entry.name] = value.to(DTYPES[entry.dtype], copy=True)
        return TensorDict(found, [len(rows)]).unflatten_keys("/")
