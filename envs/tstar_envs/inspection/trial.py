"""The scripted assembler on a piece: how often each step works, and in plain words how it fails."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture.schema import Furniture
from tstar_envs.tasks.phase_reward import PHASES

SPEED = 0.4
"""Velocity scale of a trial, as skills are trained at on a small machine."""
LONG = 120
"""Control steps: skills are trained in episodes of 150, and a learned one is slower than the script."""


class Trial(NamedTuple):
    """What became of the episodes of one step, or (`step` None) of the whole piece."""

    step: int | None
    episodes: int
    success: float  # share of the episodes
    length: float  # control steps, mean over the successes; NaN without one
    failures: str  # how the others failed, in words
    phase: str  # of the reward, that most successes of a step came to; the last one where `step` is None
    other_way: bool  # the part mostly comes round the other way than starts at the next step suppose

    def __str__(self) -> str:
        what = "whole piece" if self.step is None else f"steps[{self.step}]"
        how = f"; {self.failures}" if self.failures else ""
        if self.phase != PHASES[-1]:
            how += f"; it never ends the reward's phase {self.phase}, so that no later one pays"
            how += " (is the waypoint on its way?)" if self.phase == "lift_leg" else ""
        if self.other_way:
            how += "; it turns the part the other way round than the starts have it in which the next skill learns,"
            how += " so that its quaternion has another sign (write degrees: -180 for 180, or 180 for -180)"
        if self.step is not None and self.length > LONG:
            how += f"; that is more than {LONG}, and skills are trained in episodes of 150: shorten the step"
        took = f", in {self.length:.0f} control steps" if self.success else ""
        return f"{what}: {self.success:.0%} of {self.episodes}{took}{how}"


def try_out(furniture: Furniture, step: int | None, episodes: int = 20, seed: int = 0) -> Trial:
    """Runs the scripted assembler from noisy starts, the steps before preassembled with jitter."""
    settings = {"velocity_scale": SPEED, "preassembled": "jitter"}
    world = BatchedEnvironment(furniture, episodes, step, 1, seed, settings)
    world.reset()
    expert, none = world.expert(), torch.zeros(episodes, dtype=torch.bool)
    running, success, wrong, touched, failed = ~none, none.clone(), none.clone(), none.clone(), none.clone()
    other_way, completed = none.clone(), torch.zeros(episodes, dtype=torch.int64)
    length, phase = torch.zeros(episodes), torch.zeros(episodes, dtype=torch.int64)
    while running.any():
        world.step(expert.act(world.state))
        for seen, name in ((success, "success"), (wrong, "wrong"), (failed, "failed")):
            seen |= world.state[name] & running
        won = world.state["success"] & running
        if bool(won.any()):
            other_way |= won & _other_way(world, step)
        on = world.state["completed"] > completed  # at the next step, whose part was not touched yet
        completed = torch.maximum(completed, world.state["completed"])
        touched = (touched & ~on) | (world.task.scene(world.state).touching & running)
        length += running
        phase = torch.where(running & ~success, torch.maximum(phase, world.state["phase"]), phase)
        terminated, truncated = world.task.get_termination(world.state)
        running &= ~(terminated | truncated)
    last = world.task.scene(world.state)
    ends = {
        "joined the wrong connectors": wrong,
        "was given up by the simulator": failed,
        "never had the part between both fingers": ~touched,
        "lost the part": touched & ~last.touching,
        "held the part but could not bring the connectors together": touched & last.touching,
    }
    share = float(success.double().mean())
    mean = float(length[success].mean()) if bool(success.any()) else float("nan")
    turned = int(other_way.sum()) > int(success.sum()) / 2
    one_step = step is not None and bool(success.any())
    furthest = PHASES[int(phase[success].median())] if one_step else PHASES[-1]
    failures = _words(ends, ~success)
    if step is None and failures:
        failures += f", most at steps[{int(completed[~success].mode().values)}]"
    return Trial(step, episodes, share, mean, failures, furthest, turned)


def _other_way(world: BatchedEnvironment, step: int | None) -> Tensor:
    """(N,) bool: whether the part of `step` has the quaternion -q, where starts at the next step have one near q."""
    tables, poses = world.task.tables, world.task.part_poses
    if step is None or step == tables.num_steps - 1:
        return torch.zeros(len(poses), dtype=torch.bool)
    part = int(tables.moving[step])
    return poses[:, part, 3:] @ tables.nominal_poses()[step + 1, part, 3:] < 0


def _words(ends: dict[str, Tensor], left: Tensor) -> str:
    """Each failure by the first of `ends` that holds for it."""
    said = []
    for text, which in ends.items():
        count = int((which & left).sum())
        if count:
            said.append(f"{count} {text}")
        left = left & ~which
    return ", ".join(said)
