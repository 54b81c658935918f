"""What was measured of a finished training: deleted when it starts over or goes on, since it is of another policy then.

What measures: recipes evaluate, hand_over, hand_over_gap, exchanged, moved_parts, ways_home and plot_latents.
"""

from collections.abc import Collection
from contextlib import suppress
from itertools import product
from pathlib import Path

from tstar_rl.runs.csv_tables import read_table, write_table
from tstar_rl.runs.files import turn_to_write
from tstar_rl.runs.run_config import DamagedConfigError, read_config
from tstar_rl.runs.run_folder import SAVED, UNTRAINED

__all__ = ["chains_of", "forget_measurements"]

OF_A_RUN = (
    *("evaluation.csv", "moved_parts.csv", "ways_home.csv", "latents.csv", "latents.png"),
    *("first_success.mp4", "first_failure.mp4", "episodes.html"),
)
"""Tables, films and pictures in the folder of the run's results."""
OF_CHAINS = (
    *("hand_over.csv", "hand_over_gap.csv", "seams.csv", "anatomy.csv", "terminal_states_spread.csv"),
    *("exchanged.csv", "exchanged_*.csv"),
)
"""Tables in the task's folder, with a row or some for each system and seed."""


def chains_of(skills: str, task: Path, seed: int, usual: bool) -> dict[str, Path]:
    """Chains of these skills as they are, by their system: the folders of what was measured of them.

    Whose skills a chain is made of its config.yaml says, which `evaluate.py` writes; one that was measured otherwise
    alone is known only as the usual one.

    Args:
        skills: the system that the skills were trained by.
        task: the folder of results of their task.
        seed: of the skills.
        usual: whether the chain that is called `UNTRAINED` is of these skills where it does not say.
    """
    found = {
        folder.parent.relative_to(task).as_posix(): folder
        for folder in task.glob(f"**/{UNTRAINED}*/seed{seed}")
    }
    if usual:
        found[UNTRAINED] = task / UNTRAINED / f"seed{seed}"
    unsaid = {UNTRAINED: skills} if usual else {}
    return {
        system: folder for system, folder in found.items() if _skills(folder, unsaid.get(system)) == skills
    }


def _skills(folder: Path, unsaid: str | None) -> str | None:
    """Whose skills the config.yaml of an untrained chain says that it has; of one that is damaged nothing is known."""
    with suppress(DamagedConfigError):
        return read_config(folder).get("skills", unsaid)
    return None


def forget_measurements(runs: Collection[Path], task: Path, systems: Collection[str], seed: int) -> None:
    """Deletes a run's measurements; other runs' rows stay.

    Args:
        runs: folders of its results, and of those of chains that are nothing but its skills.
        task: the folder of results of its task.
        systems: the chains that it has part in.
        seed: of the run.

    Raises:
        LogError: a table of the task is damaged; nothing of that table, or of those after it, is changed.
    """
    for pattern in OF_CHAINS:
        for path in task.glob(pattern):
            _drop(path, systems, seed)
    for run in runs:
        below = [run / name for name in SAVED]  # of one skill of a chain, evaluated by its path
        for place, name in product((run, *below), OF_A_RUN):
            (place / name).unlink(missing_ok=True)
        for place in below:
            with suppress(DamagedConfigError, OSError):
                if read_config(place).get("evaluation_only"):
                    (place / "config.yaml").unlink()
                place.rmdir()  # where something else is in it, it stays


def _drop(path: Path, systems: Collection[str], seed: int) -> None:
    against = {f"exchanged_{name.replace('/', '_')}.csv" for name in systems}
    with turn_to_write(path.parent):
        if not path.is_file():  # a run beside this one has just taken the last rows
            return
        table = read_table(path)
        if not {"system", "seed"} <= set(table):  # a table of the user's own that has such a name
            return
        theirs = table["seed"] == seed
        if path.name not in against:  # there the skills of all chains were exchanged with those of this one
            theirs &= table["system"].isin(list(systems))
        if theirs.all():
            path.unlink()
        elif theirs.any():
            write_table(path, table[~theirs])
