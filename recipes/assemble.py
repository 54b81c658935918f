"""The whole pipeline: demonstrations, skills, chaining three ways, evaluation, films, curves.

    python recipes/assemble.py scale=laptop seed=0        # or scale=quick

What is given on the command line is passed on to every step. A step that is done is not done again; one that was
killed goes on from its last checkpoint.
"""

import time

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.configuration import recipe
from tstar_rl.logging import run_path
from tstar_rl.side_by_side import mean_bonus, run_recipe, run_side_by_side

OWN = ("processes",)  # values that only this recipe knows


@recipe("assemble", processes=int)
def main(config: DictConfig) -> None:
    """Runs the steps, two at a time where they do not wait for each other."""
    began, processes = time.perf_counter(), config.processes
    given = HydraConfig.get().overrides.task
    shared = [value for value in given if value.split("=")[0] not in OWN]
    subtasks = [f"subtask={index}" for index in range(config.task.subtasks)]
    kinds = f"kinds=[{config.demonstrations.kind}]"

    run_side_by_side([[("make_demonstrations", one, kinds)] for one in subtasks], shared, processes)
    run_side_by_side([[("gail_ppo", one)] for one in subtasks], shared, processes)
    skills = [("evaluate", "system=gail_ppo", one) for one in subtasks]
    run_side_by_side(
        [
            [("tstar",), ("evaluate", "system=tstar")],
            [
                ("policy_sequencing",),
                ("evaluate", "system=policy_sequencing"),
                ("evaluate", "system=no_finetuning"),
            ],
        ],
        shared,
        processes,
    )
    control = "policy_sequencing_bonus"
    bonus = mean_bonus(run_path(config.results_dir, config.task.name, "tstar", config.seed) / "metrics.csv")
    lane = [
        ("policy_sequencing", f"system={control}", f"bonus={bonus}"),
        ("evaluate", f"system={control}"),
    ]
    run_side_by_side([lane, skills], shared, processes)
    run_recipe(("plot",), shared)
    print(f"all of it took {(time.perf_counter() - began) / 60:.1f} minutes")


if __name__ == "__main__":
    main()
