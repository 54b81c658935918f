"""Films of the first success and the first failure of an evaluation."""

from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

__all__ = ["Recorder"]


class Recorder:
    """Remembers what the simulations did, to film the first success and the first failure among them.

    Args:
        env: with `qpos_of` and `write_mp4`, and snapshots=True.
        number: of the first so many simulations; None: of all, which takes 4 nq bytes a step of each (200 episodes of
            800 steps: 28 MB); 0: of none.
    """

    def __init__(self, env: Any, number: int | None = None) -> None:
        if number is not None and number < 0:
            raise ValueError(f"number must not be negative, got {number}")
        self.env, self.number = env, number
        self.positions: list[Tensor] = []
        self.success: list[Tensor] = []
        self.done: list[Tensor] = []

    def __call__(self, tensordict: TensorDictBase) -> None:
        """Takes the step's TensorDict, batch [N]."""
        if self.number != 0:
            following = tensordict["next"][: self.number]
            qpos = self.env.qpos_of(following["snapshot"])
            self.positions.append(qpos.to("cpu", torch.float32, copy=True))
            self.success.append(following["success"].squeeze(-1).clone().cpu())
            self.done.append(following["done"].squeeze(-1).clone().cpu())

    def write(self, folder: Path) -> list[Path]:
        """Writes first_success.mp4 and first_failure.mp4, those that there are; returns their paths.

        Films of an earlier evaluation are deleted first, unless nothing was to be remembered.
        """
        written = []
        if self.number == 0:
            return written
        success, done = torch.stack(self.success), torch.stack(self.done)
        ends = done.int().argmax(0)  # the first step that ended each episode
        won = success[ends, torch.arange(len(ends))]
        for name, rows in (("first_success", won), ("first_failure", ~won)):
            path = folder / f"{name}.mp4"
            path.unlink(missing_ok=True)
            if rows.any():
                row = int(rows.int().argmax())
                film = torch.stack([qpos[row] for qpos in self.positions[: int(ends[row]) + 1]])
                if self.env.write_mp4(path, film):
                    written.append(path)
        return written
