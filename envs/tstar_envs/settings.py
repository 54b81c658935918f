"""What a user may set of the assembly task, with the task's own figures as defaults."""

from __future__ import annotations

import dataclasses
import difflib
import numbers
from collections.abc import Mapping
from typing import Any

from tstar_envs.checks import is_finite, short

MOST = {
    "part_noise": 0.25,  # further off, parts lie where the arm does not reach
    "part_noise_degrees": 180.0,
    "drop_height": 0.2,  # from there a part falls for 0.2 s of the 0.3 s in which it settles
    "arm_noise": 1.0,  # the home pose is 1.18 rad from the nearest end of a joint's range
    "jitter": 0.04,  # 7 cm in all: connectors that are welded 10 cm apart are no connection (`snapshot_check`)
    "jitter_degrees": 45.0,
}
"""The largest value of a setting of the start."""
MOST_STEPS = {"settle_steps": 100_000, "retreat_steps": 10_000, "max_steps": 1_000_000}
"""Of settings that count steps. A larger number is a typing error: an episode would take minutes to start, or would
hardly end."""
AT_LEAST_ONE = ("max_steps", "settle_steps")


@dataclasses.dataclass(frozen=True)
class TaskSettings:
    """Settings of an assembly task. Source: docs/task.md unless a line says otherwise.

    Lengths in m, angles in degrees where the name says so. NumPy's numbers become Python's.
    Settings of the start have an upper bound, `MOST`, and so have some that count steps, `MOST_STEPS`.
    """

    velocity_scale: float = 1.0
    """Share of the joint velocity limits that an arm action of 1 asks for."""
    gripper: str = "sign"
    """`sign`: the gripper action's sign opens or closes; `continuous`: it places the fingers."""
    part_noise: float = 0.02
    """Start noise of every part in x and y, uniform in [-part_noise, part_noise]."""
    part_noise_degrees: float = 3.0
    """Start noise of every part's yaw, uniform."""
    drop_height: float = 0.01
    """Parts start this far above where they are laid out, and settle."""
    settle_steps: int = 30
    """Physics steps that the parts are given to settle."""
    arm_noise: float = 1e-3
    """Start noise of the arm's joints, rad, uniform."""
    preassembled: str = "ideal"
    """Where earlier steps are preassembled: `ideal`ly, or with `jitter` about it."""
    jitter: float = 0.012
    """With `jitter`: offset of the moving connector in each direction of the target connector's plane and away from it,
    uniform; all three together, with the clearance that is kept, come to 21 mm at most."""
    jitter_degrees: float = 5.0
    """With `jitter`: tilt of the moving connector about a random axis."""
    snap: bool = False
    """Connecting moves the part to its ideal pose first: an easy mode, not the paper's. With `reset_robot: false` the
    closed hand stays where it was, and its pads may end inside the part."""
    reset_robot: bool = True
    """The arm goes back home, gripper open, after connecting."""
    retreat_steps: int = 0
    """With `reset_robot: false`: control steps after connecting in which the hand lets go and the arm draws back
    towards home, pushing what is in its way; 0: it stays, the hand closed. The time limit does not count them."""
    skipped_phases: str = "paid"
    """Connecting before the last phase pays the bonuses of the phases left out (`paid`), or its own alone (`unpaid`, as
    in the paper). Source: docs/decisions/0007-chair.md."""
    end_on_disturbance: bool = False
    """A target that moved by more than 0.1 m ends the episode as a failure."""
    max_steps: int = 200
    """Control steps for one subtask; K times as many for the whole task."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value, kind = getattr(self, field.name), type(field.default)
            _check_type(field.name, value, kind)
            if type(value) not in _TYPES:
                object.__setattr__(self, field.name, kind(value))
        _check_choice("gripper", self.gripper, ("sign", "continuous"))
        _check_choice("preassembled", self.preassembled, ("ideal", "jitter"))
        _check_choice("skipped_phases", self.skipped_phases, ("paid", "unpaid"))
        if not 0 < self.velocity_scale <= 1:
            raise ValueError(f"setting velocity_scale must be in (0, 1], got {self.velocity_scale}")
        for name in (*MOST, "retreat_steps"):
            if (value := getattr(self, name)) < 0:
                raise ValueError(f"setting {name} must not be negative, got {short(value)}")
        for name, most in (MOST | MOST_STEPS).items():
            if (value := getattr(self, name)) > most:
                least = 1 if name in AT_LEAST_ONE else 0
                raise ValueError(f"setting {name} must be from {least} to {most:.7g}, got {short(value)}")
        if self.retreat_steps and self.reset_robot:
            raise ValueError(
                f"setting retreat_steps={self.retreat_steps} needs reset_robot=false: the arm is put home otherwise"
            )
        for name in AT_LEAST_ONE:
            if getattr(self, name) < 1:
                raise ValueError(f"setting {name} must be at least 1, got {getattr(self, name)}")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> TaskSettings:
        """Builds settings from plain values; an unknown name raises with the nearest valid one."""
        if not isinstance(values, Mapping):
            raise ValueError(f"settings are a mapping of names to values, got {values!r}")
        for name in values:
            if told := cls._unknown(name):
                raise ValueError(f"unknown task setting {told}")
        return cls(**values)

    @classmethod
    def from_keywords(cls, function: str, values: Mapping[str, Any]) -> TaskSettings:
        """Builds settings from the keywords that `function` was called with.

        Raises:
            TypeError: a keyword is no setting, as everywhere in Python.
            ValueError: a value is not a setting's.
        """
        for name in values:
            if told := cls._unknown(name):
                raise TypeError(f"{function}() got an unexpected keyword argument {told}")
        return cls(**values)

    @classmethod
    def _unknown(cls, name: str) -> str:
        """What to say of a name that is no setting; nothing of one that is."""
        valid = [field.name for field in dataclasses.fields(cls)]
        if name in valid:
            return ""
        near = difflib.get_close_matches(str(name), valid, n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        return f"{name!r}{hint}; valid settings: {', '.join(valid)}"


_TYPES = {bool: bool, int: numbers.Integral, float: numbers.Real, str: str}


def _check_type(name: str, value: Any, kind: type) -> None:
    number = kind in (int, float)
    if not isinstance(value, _TYPES[kind]) or (number and isinstance(value, bool)):
        raise ValueError(f"setting {name} must be of type {kind.__name__}, got {value!r}")
    if number and not is_finite(value):
        raise ValueError(f"setting {name} must be finite, got {short(value)}")


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(f"setting {name} must be one of {', '.join(choices)}; got {value!r}")
