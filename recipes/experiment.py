"""A declared experiment: whatever is missing of it, some seeds at a time, for as long as it takes or is allowed.

    python recipes/experiment.py experiment=terminal_state_regularisation
    python recipes/experiment.py experiment=terminal_state_regularisation minutes=150

configs/experiment/<name>.yaml has the experiment; the page that it names declares it. A call that ends early, or is
killed, goes on when it is given again: what is finished is not done again, and a training goes on from its
checkpoint. All arms must come from one commit: run it in a checkout of its own, `git worktree add ../experiment
<commit>`, with PYTHONPATH=<checkout>:<checkout>/envs where the environment has another one's code. Tables land in
results/<name>/; with publish=true those of finished runs are copied to results/published/<name>/.
"""

import subprocess
import threading
import time
from typing import Any

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.load import plain, recipe
from tstar_rl.launch.experiment import publish, with_bonus, without_bonus
from tstar_rl.launch.experiment_values import parse_experiment
from tstar_rl.launch.side_by_side import Step, run_recipe, run_side_by_side
from tstar_rl.launch.steps import is_done, passed_on, step_config

OWN = ("experiment", "processes", "minutes", "publish", "seeds", "tasks", "arms")


@recipe(
    "experiment", experiment=dict[str, Any] | None, processes=int, minutes=float | None, publish=bool,
    seeds=tuple[int, ...] | None, tasks=tuple[str, ...] | None, arms=tuple[str, ...] | None,
)  # fmt: skip
def main(config: DictConfig) -> None:
    """Runs a lane for each task and seed; a lane that waits for a bonus finds it when it gets there."""
    if config.experiment is None:
        raise InvalidValueError("say which: experiment=<name> of configs/experiment")
    declared = parse_experiment(plain(config)["experiment"])
    declared.check_arms(config.arms or ())
    end = None if config.minutes is None else time.monotonic() + 60 * config.minutes
    given = passed_on(OWN)
    lanes: list[list[Step]] = []
    for task, seed in declared.lanes(config.seeds or (), config.tasks or ()):
        shared = [*declared.shared(task, seed), *given]
        subtasks = step_config(("gail_ppo",), shared).task.subtasks
        lanes.append([(step[0], *shared, *step[1:]) for step in declared.steps(subtasks, seed, config.arms)])

    composing = threading.Lock()  # Hydra composes one config at a time

    def run(step: Step, shared: list[str], line: int) -> None:
        with composing:
            place = step_config(without_bonus(step))
            step = with_bonus(step, place.results_dir, place.task.name, place.seed)
            done = is_done(step, ignored=("bonus",))
        if not done:
            left = None if end is None else end - time.monotonic()
            if left is not None and left <= 0:
                raise SystemExit("the time is over")
            try:
                run_recipe(step, (), line, left)
            except subprocess.TimeoutExpired:
                raise SystemExit("the time is over") from None

    try:
        run_side_by_side(lanes, (), config.processes, run)
    except SystemExit as stop:
        reasons = set(str(stop).splitlines())
        if reasons != {"the time is over"}:
            raise
        print("The time is over; the same command goes on.")
    if config.publish:
        results = step_config(lanes[0][0]).results_dir
        print("\n".join(map(str, publish(results, f"results/published/{declared.name}"))))


if __name__ == "__main__":
    main()
