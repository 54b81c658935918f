"""A run of one small module, and what it leaves."""

from collections.abc import Mapping
from pathlib import Path

import torch

from tstar_rl.runs.run import Run


def a_run(
    folder: Path,
    resume: bool = True,
    trials: bool = False,
    unread: tuple[str, ...] = (),
    subtask: int | None = None,
    notes: Mapping[str, object] | None = None,
    **values,
) -> Run:
    config = {
        "task": {"name": "table"},
        "system": "chain",
        "seed": 0,
        "resume": resume,
        "progress_bar": False,
    }
    places = {"results_dir": str(folder / "results"), "runs_dir": str(folder / "runs")}
    return Run({**config, **places, **values}, subtask, trials=trials, unread=unread, notes=notes)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but the lock, which says who holds it."""
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in folder.rglob("*")
        if p.is_file() and p.name != "lock"
    }


def a_run_that_saved(folder: Path) -> torch.nn.Module:
    """A run with two rows, of which its checkpoint has one; its module's weight is 1."""
    module = torch.nn.Linear(1, 1)
    module.weight.data.fill_(1.0)
    run = a_run(folder)
    run.start(module=module)
    run.log(10, success_rate=0.5)
    run.save_if_due(0)
    run.log(20, success_rate=0.6)
    return module
