"""T-STAR on a GPU, from nothing to its evaluation, in slices: first what learns fastest, then the paper's budget.

    while python recipes/gpu_run.py; [ $? = 75 ]; do :; done

One call works for `minutes` and then stops what it is at; the next call leaves out what is done and goes on from the
last checkpoint. It ends with 75 while there is more to do, with 0 once there is not, and with 1 where all of a call's
time leaves nothing that the next call could go on from. Tables land where the scales say (results/gpu,
results/paper_gpu), with the minutes of each step in gpu_run.csv beside them. Other values that are given are passed on
to every step: `scales=[quick] device=cpu` is a look without a GPU.
"""

import time
from pathlib import Path

from hydra import compose
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.load import recipe
from tstar_rl.launch.backends import check_local
from tstar_rl.launch.overrides import passed_on
from tstar_rl.launch.side_by_side import Step
from tstar_rl.launch.steps import is_done, left_behind, step_config
from tstar_rl.launch.time_limit import MORE, TimeIsOver, check_goes_on, deadline, run_until
from tstar_rl.runs.csv_tables import append_rows, read_table
from tstar_rl.runs.run_folder import run_path

OWN = ("minutes", "scales", "scale", "video")  # values that only this recipe knows


@recipe("gpu_run", minutes=float, scales=tuple[str, ...], video=bool)
def main(config: DictConfig) -> None:
    """Takes the steps that are missing, one after another, until the time is over."""
    check_local(config.launch, "gpu_run.py")
    if any(value.startswith("scale=") for value in HydraConfig.get().overrides.task):
        raise InvalidValueError("gpu_run.py takes scales=[...], one after another; leave scale=... out")
    check_goes_on(config.resume, "gpu_run.py")
    end, whole = deadline(config.minutes), True
    given = passed_on(OWN)
    for scale in config.scales:
        shared = [f"scale={scale}", *given]
        place = compose("recipe/gail_ppo", shared)
        for step in _steps(place, config.video):
            if is_done(step, shared):
                continue
            own = step_config(step, shared)
            before = left_behind(step, own)
            taken = _take(step, shared, end, place)
            # Whether nothing in this call has got any further so far.
            whole = whole and left_behind(step, own) == before
            if not taken and whole:
                raise SystemExit(
                    f"{' '.join(step)} had all {config.minutes:g} minutes of a call and left nothing to go on "
                    "from: give it more minutes"
                )
            if not taken:
                raise SystemExit(MORE)
        table = read_table(
            run_path(place.results_dir, place.task.name, "tstar", place.seed) / "evaluation.csv"
        )
        print(f"scale={scale}", table.round(3).to_string(index=False), sep="\n")


def _steps(place: DictConfig, video: bool) -> list[Step]:
    """All steps of one scale, in order."""
    film, subtasks = f"video={str(video).lower()}", range(place.task.subtasks)
    skills: list[Step] = [("gail_ppo", f"subtask={index}") for index in subtasks]
    tries: list[Step] = [("evaluate", "system=gail_ppo", film, f"subtask={index}") for index in subtasks]
    chains: list[Step] = [
        ("tstar",),
        ("evaluate", "system=tstar", film),
        ("evaluate", "system=no_finetuning", film),
    ]
    return [("make_demonstrations", f"kinds=[{place.demonstrations.kind}]"), *skills, *tries, *chains]


def _take(step: Step, shared: list[str], end: float, place: DictConfig) -> bool:
    """Takes a step, or as much of it as there is time for; returns whether that was all of it."""
    began = time.monotonic()
    try:
        run_until(end, step, shared)
    except TimeIsOver:
        return False
    finally:
        _note(place, " ".join(step), (time.monotonic() - began) / 60)
    return True


def _note(place: DictConfig, step: str, minutes: float) -> None:
    """Adds to the minutes that a step of one task and seed has taken, over all slices."""
    file, key = Path(place.results_dir) / "gpu_run.csv", ("task", "seed", "step")
    row = (place.task.name, place.seed, step)
    before = read_table(file).set_index(list(key))["minutes"].get(row, 0.0) if file.is_file() else 0.0
    append_rows(file, [{**dict(zip(key, row, strict=True)), "minutes": round(before + minutes, 2)}], key)


if __name__ == "__main__":
    main()
