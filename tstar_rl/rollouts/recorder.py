"""Shows the first success and the first failure of an evaluation: films, and a page that plays them."""

from pathlib import Path
from typing import Any

from tensordict import TensorDictBase

from tstar_rl.rollouts.watching import EpisodeLog

__all__ = ["Recorder"]

STUCK = 200
"""Control steps (20 s, 10 s of film) after the last subtask done, where the film of a failure ends.

The page plays all of it.
"""


class Recorder:
    """Remembers what the simulations did, to show the first success and the first failure among them.

    Args:
        env: with `qpos_of`, `write_mp4` and `write_player`, and snapshots=True.
        number: how many simulations are recorded, from the first on; 0: none; None: all. That takes 4 (nq + 5) bytes a
            step of each: 31 MB for 200 episodes of 800 steps.
        enough: see `EpisodeLog`.
    """

    def __init__(
        self,
        env: Any,
        number: int | None = None,
        enough: int | None = None,
    ) -> None:
        if number is not None and number < 0:
            raise ValueError(f"number must not be negative, got {number}")
        self.env, self.number = env, number
        self.log = EpisodeLog(env, number, enough=enough)

    def __call__(self, tensordict: TensorDictBase) -> None:
        """Takes the step's TensorDict, batch [N]."""
        if self.number != 0:
            self.log(tensordict)

    def write(self, folder: Path) -> list[Path]:
        """Writes first_success.mp4, first_failure.mp4 and, with either, episodes.html; returns the paths of those made.

        What an earlier evaluation left is deleted first, unless nothing was to be remembered.
        """
        written, shown = [], []
        if self.number == 0:
            return written
        won = self.log.successes()
        for name, rows in (("first_failure", ~won), ("first_success", won)):
            path = folder / f"{name}.mp4"
            path.unlink(missing_ok=True)
            if rows.any():
                row = int(rows.int().argmax())
                shown.append(self.log.episode(row, name.replace("_", " ")))
                steps = int(self.log.lengths()[row]) if won[row] else self.log.last_done(row) + STUCK
                if self.env.write_mp4(path, self.log.positions(row)[1 : steps + 1]):
                    written.append(path)
        return [*written, self.env.write_player(folder / "episodes.html", shown)]
