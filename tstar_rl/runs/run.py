"""What a run leaves behind: a table of metrics, its config, checkpoints to resume from, and a progress bar.

`results/<task>/<system>/seed<k>[/subtask<i>]/` holds what is kept (config.yaml, metrics.csv, evaluation.csv, and of
a chain terminal_states.csv and calibration.csv);
`runs/` mirrors it with what is large or depends on the machine (checkpoints, skills, timing.csv).
"""

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from torchrl.checkpoint import GlobalRNGState
from tqdm import tqdm

from tstar_rl.checks import InvalidValueError, check_losses
from tstar_rl.runs import checkpoint, lock
from tstar_rl.runs.best_so_far import BestSoFar
from tstar_rl.runs.csv_tables import LogError
from tstar_rl.runs.files import flush, put_back, remove_folder, replacing
from tstar_rl.runs.measured import chains_of, forget_measurements
from tstar_rl.runs.mismatch import FURNITURE, MACHINE_ONLY, CheckpointMismatchError, as_begun, known_then
from tstar_rl.runs.previous_run import PreviousRun
from tstar_rl.runs.run_config import note_resumed, note_section, read_config, restore_config, write_config
from tstar_rl.runs.run_folder import CHECKPOINTS, FINISHED, SAVED, UNFINISHED, run_path
from tstar_rl.runs.run_tables import RunTables

__all__ = ["Run"]

NEEDED = ("task", "system", "seed", "results_dir", "runs_dir", "resume", "progress_bar")
"""What a run reads of its config; of the task its name."""


class Run:
    """Log, progress bar and checkpoints of one run of a recipe.

    Args:
        config: plain values; recorded, and compared when resuming. Read are task.name, system, seed, results_dir and
            runs_dir, which say where the run lies, resume, progress_bar and, where they are there, env and furniture.
            Configs of a recipe also have "recipe", its name, and "furniture", the digest of the task's file.
        subtask: that the run trains, or None.
        total: environment steps after which the run ends; a `SkillTraining` and the turns of a chain need it.
        trials: whether the best so far is told by trials; see `BestSoFar`.
        unread: sections of the config that the recipe does not read: they may differ when the run is resumed.
        notes: what config.yaml says beside the config, of a run that begins anew.

    Attributes:
        tables: what it logs; `log` adds to metrics and timing.

    Raises:
        InvalidValueError: if the config lacks one of `NEEDED`.
        RunInUseError: if another process runs in the same folder.
    """

    def __init__(
        self,
        config: Mapping[str, Any],
        subtask: int | None = None,
        total: int | None = None,
        trials: bool = False,
        unread: Sequence[str] = (),
        notes: Mapping[str, Any] | None = None,
    ) -> None:
        if lacking := [name for name in NEEDED if name not in config]:
            raise InvalidValueError(
                f"a run's config has no {', '.join(lacking)}; it needs {', '.join(NEEDED)}"
            )
        place = (config["task"]["name"], config["system"], config["seed"], subtask)
        self.results = run_path(config["results_dir"], *place)
        self.work = run_path(config["runs_dir"], *place)
        self._hold()
        self.record = {name: value for name, value in config.items() if name not in (*MACHINE_ONLY, *unread)}
        self.record["subtask"] = subtask
        self.config, self.notes, self.total = config, notes or {}, total
        self.env_steps, self.seconds, self.turn = 0, 0.0, 0
        self.best = BestSoFar(trials)
        self.components: dict[str, Any] = {}
        self.tables = RunTables(self.results, self.work)
        self._last_save, self._clock = 0, time.perf_counter()
        self._kept: Mapping[str, Any] | None = None
        label = config["system"] if subtask is None else f"{config['system']} {subtask}"
        self.bar = tqdm(
            total=total,
            desc=label,
            unit="step",
            unit_scale=True,
            disable=not config["progress_bar"],
        )

    @property
    def origin(self) -> dict[str, Any]:
        """What a skill or a chain that the run saves says of where it is from: its system, and its world."""
        return {
            "recipe": self.config["system"],
            "env": self.config.get("env"),
            FURNITURE: self.config.get(FURNITURE),
        }

    def _hold(self) -> None:
        """Takes both folders: runs with one results folder and two of work would write one table."""
        lock.hold(self.work)
        try:
            lock.hold(self.results)
        except lock.RunInUseError:
            lock.release(self.work)
            raise

    def start(self, **components: Any) -> int:
        """Names what a checkpoint holds, resumes from one if there is one, and returns the steps done so far.

        A run that begins anew deletes what one before it has left under its name: checkpoints, evaluations and what was
        measured of it (`measured`). One that has finished with the same config begins anew with resume=false alone.

        Raises:
            NothingToDo: if it has finished, and no more steps are asked for.
            MissingFileError: if it has, and its tables are elsewhere; or if it is here in part.
            CheckpointMismatchError: when resuming a run that had another config, or where one of another has finished,
                or where the tables are those of another. Nothing is touched then.
            DamagedCheckpointError: if the newest checkpoint is not as it was written. Nothing is touched then.
            LogError: if a table of the run has lost rows.
            InvalidValueError: if something else lies where it would save what it trains.
        """
        self.components = {**components, "run": self, "rng": GlobalRNGState()}
        for name in SAVED:
            # before hours of training, and before anything is deleted
            checkpoint.check_place(self.work / name)
        for name in ("best", "last"):
            put_back(self.work / name)
        found, previous = None, PreviousRun(self.results, self.work, self.record)
        if self.config["resume"]:
            found = checkpoint.latest(self.work / CHECKPOINTS)
            previous.check_tables()
            if found is None:
                previous.check_that_nothing_is_lost()
        if found is None:
            self._begin_anew()
        else:
            self._go_on(found, previous)
        self.bar.update(self.env_steps - self.bar.n)
        self._clock = time.perf_counter()
        return self.env_steps

    def _begin_anew(self) -> None:
        """Deletes what is there, and writes the config."""
        self._forget_measurements()
        (self.work / UNFINISHED).touch()
        (self.work / FINISHED).unlink(missing_ok=True)  # before the rest: what is half deleted is not done
        for name in (CHECKPOINTS, *SAVED):
            remove_folder(self.work / name)
        self.tables.clear()
        write_config(self.results, {**self.config, **self.notes})

    def _go_on(self, found: Path, previous: PreviousRun) -> None:
        """Loads the checkpoint, if it is of this run, and notes that the run went on."""
        try:
            saved = checkpoint.read_record(found)
            asked = known_then(saved, self.record)
            begun = as_begun(saved, asked)
            checkpoint.read_record(found, **begun)
            changed = [section for section in begun if begun[section] != asked[section]]
            previous.stop_if_done(changed)  # before its tables go back to the checkpoint
            checkpoint.load(found, self.components, **begun)  # refused here, it leaves all as it is
        except (CheckpointMismatchError, checkpoint.DamagedCheckpointError, LogError) as error:
            raise type(error)(f"{error} (resume=false starts over)") from error
        if changed:
            self._forget_measurements()  # of the run with fewer steps
        (self.work / FINISHED).unlink(missing_ok=True)  # before the rest: until it is done again
        if self._kept is not None:  # the checkpoint had where the log stood
            self.tables.truncate(self._kept)
        if not read_config(self.results):
            restore_config(self.results, self.config)
        note_resumed(self.results, self.env_steps)
        for section in changed:  # that of more steps, if any
            note_section(self.results, section, self.record[section])

    def _forget_measurements(self) -> None:
        """Deletes what was measured of the run that lies here; of a skill's also what was of its untrained chains."""
        system, seed, chains = self.config["system"], self.config["seed"], {}
        task = Path(self.config["results_dir"]) / self.config["task"]["name"]
        if self.record["subtask"] is not None:
            chains = chains_of(system, task, seed, usual=self.config.get("skills") == system)
        forget_measurements([self.results, *chains.values()], task, {system, *chains}, seed)

    def log(self, env_steps: int, **row: Any) -> None:
        """Adds a row at `env_steps` and moves the bar.

        Raises:
            DivergedError: if a loss is no finite number. Neither the row nor anything after it is written.
        """
        check_losses(row, f"after {env_steps} environment steps of {self.work}")
        now = time.perf_counter()
        steps = env_steps - self.env_steps
        self.seconds, self._clock = self.seconds + now - self._clock, now
        self.env_steps = env_steps
        self.best.add(row)
        self.tables.metrics.append({"env_steps": env_steps, **row})
        minutes = self.seconds / 60
        self.tables.timing.append({"env_steps": env_steps, "minutes": minutes, "steps": steps})
        self.bar.update(env_steps - self.bar.n)
        self.bar.set_postfix(success=str(self.best))

    def save_if_due(self, every: int) -> None:
        """Writes a checkpoint if `every` environment steps have gone by since the last one.

        Whatever can `settle` does so first, in a run that goes on just as in one that is resumed.
        """
        if self.env_steps - self._last_save < every:
            return
        self._last_save = self.env_steps
        for component in self.components.values():
            if hasattr(component, "settle"):
                component.settle()
        self.tables.flush()
        checkpoint.save_step(self.work / CHECKPOINTS, self.env_steps, self.components, self.record)

    def state_dict(self) -> dict[str, Any]:
        """Where the log stands."""
        return {
            **self.tables.state_dict(),
            "env_steps": self.env_steps,
            "seconds": self.seconds,
            "last_save": self._last_save,
            "turn": self.turn,
            **self.best.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes back to where the log stood; rows written since are dropped once all that is resumed has been loaded.

        Raises:
            LogError: if a table has lost rows.
        """
        self.tables.check(state)
        self.env_steps, self.seconds = int(state["env_steps"]), float(state["seconds"])
        self._last_save, self.turn = int(state["last_save"]), int(state["turn"])
        self.best.load_state_dict(state)
        self._kept = state

    def finish(self) -> None:
        """Closes the bar, notes that the run is complete, gives its folder back, and says where it and its log lie."""
        self.bar.close()
        self.tables.flush()
        with replacing(self.work / FINISHED) as partial:
            partial.write_text(json.dumps({"env_steps": self.env_steps, "minutes": self.seconds / 60}))
            flush(partial)
        (self.work / UNFINISHED).unlink(missing_ok=True)
        lock.release(self.work)
        lock.release(self.results)
        print(self.work, self.results / "metrics.csv", sep="\n", flush=True)
