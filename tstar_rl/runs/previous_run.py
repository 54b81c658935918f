"""What a run before has left in the folders of one that starts: whether it is this one, and whether it is done."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tstar_rl.checks import MissingFileError, NothingToDo
from tstar_rl.runs.mismatch import CheckpointMismatchError, as_begun, check_config, known_then
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import FINISHED, SAVED, UNFINISHED

__all__ = ["PreviousRun"]


@dataclass(frozen=True)
class PreviousRun:
    """The run that lies in two folders, seen by one that starts there. Nothing is changed."""

    results: Path
    """Its tables and config.yaml."""
    work: Path
    """What it trained."""
    record: Mapping[str, Any]
    """What the run that starts records of itself."""

    def stop_if_done(self, changed: Sequence[str] = ()) -> None:
        """Raises NothingToDo if the run has finished, and what it has trained is there, unless it is to go on.

        Raises:
            MissingFileError: if it has, and its tables are not where this run would write them.
        """
        if not changed and (self.work / FINISHED).is_file() and (self.work / "last").is_dir():
            if not (self.results / "config.yaml").is_file():
                raise MissingFileError(
                    f"{self.work} has finished, and its tables are not in {self.results}: give the results_dir that it "
                    "was trained with (resume=false starts over)"
                )
            raise NothingToDo(f"{self.work} has finished: nothing to do (resume=false starts over)")

    def check_tables(self) -> None:
        """Raises CheckpointMismatchError if the tables here are of a training that had another config."""
        saved = read_config(self.results)
        if not saved.get("evaluation_only"):
            check_config(self.results, saved, as_begun(saved, known_then(saved, self.record)))

    def check_that_nothing_is_lost(self) -> None:
        """Raises what `start` does where a run without checkpoints has ended, or is here in part.

        In part are its tables alone, or what it trained alone. One that was stopped before its end is not lost: a run
        without checkpoints begins anew.
        """
        if (self.work / FINISHED).is_file():
            self._check_steps()
            self.stop_if_done()
        if (self.work / "last").is_dir() and not any(
            (self.work / name).is_file() for name in (FINISHED, UNFINISHED)
        ):
            raise MissingFileError(
                f"{self.work} has what a run trained, last, and neither {FINISHED} nor checkpoints to go on from: copy "
                f"{FINISHED} there as well, or give another runs_dir (resume=false starts over)"
            )
        table = self.results / "evaluation.csv"
        saved = any((self.work / name).is_dir() for name in SAVED)
        if table.is_file() and not saved and not read_config(self.results).get("evaluation_only"):
            raise MissingFileError(
                f"{self.results} has the tables of a run that was evaluated, and nothing of it is in {self.work}: give "
                "the runs_dir that it was trained with, put that back from a copy, or give another results_dir for a "
                "new one (resume=false starts over)"
            )

    def _check_steps(self) -> None:
        """Raises CheckpointMismatchError if the run that has finished here was given fewer steps."""
        saved = read_config(self.results)
        asked = known_then(saved, self.record)
        if as_begun(saved, asked) != asked:
            raise CheckpointMismatchError(
                f"{self.work}: more steps are asked for than it was given, and it has no checkpoint to go on from: it "
                "ended before checkpoint_every steps, or the checkpoints were deleted (resume=false starts over)"
            )
