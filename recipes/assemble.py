"""The whole pipeline: demonstrations, skills, chaining three ways, evaluation, films, curves.

    python recipes/assemble.py scale=laptop seed=0        # or scale=quick; or several: seeds=[0,1,2]

What is given on the command line is passed on to every step. A step that is done is not run again; one that was killed
goes on from its last checkpoint. With launch=ray the steps run wherever a cluster has room.
"""

import time
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.config.load import recipe
from tstar_rl.launch.backends import launcher
from tstar_rl.launch.side_by_side import Step, mean_bonus, run_side_by_side
from tstar_rl.launch.steps import missing
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.runs.run_folder import run_path

OWN = ("processes", "seeds")  # values that only this recipe knows


@recipe("assemble", processes=int, seeds=tuple[int, ...] | None)
def main(config: DictConfig) -> None:
    """Runs the steps, as many at a time as there are processes, where they do not wait for each other."""
    began, place = time.perf_counter(), (config.results_dir, config.task.name)
    given = HydraConfig.get().overrides.task
    shared = [value for value in given if value.split("=")[0] not in OWN]
    subtasks = [f"subtask={index}" for index in range(config.task.subtasks)]
    kinds = f"kinds=[{config.demonstrations.kind}]"
    seeds = list(config.seeds or [config.seed])
    run = launcher(config)
    made = (Path(folder) / config.task.name for folder in (config.runs_dir, config.demonstrations_dir))
    from_nothing = not any(folder.exists() for folder in made)  # else steps that are done take no time

    def at_once(lanes: list[list[Step]]) -> None:
        run_side_by_side([missing(lane, shared) for lane in lanes], shared, config.processes, run)

    at_once(
        [
            [("make_demonstrations", one, kinds, f"seed={seed}"), ("gail_ppo", one, f"seed={seed}")]
            for seed in seeds
            for one in subtasks
        ]
    )
    at_once([lane for seed in seeds for lane in _chains(f"seed={seed}")])
    lanes = []
    for seed in seeds:
        bonus = mean_bonus(run_path(*place, "tstar", seed) / "metrics.csv")
        own = ("system=policy_sequencing_bonus", f"seed={seed}")
        lanes.append([("policy_sequencing", *own, f"bonus={bonus}"), ("evaluate", *own)])
        lanes.append([("evaluate", "system=gail_ppo", one, f"seed={seed}") for one in subtasks])
    at_once(lanes)
    run(("plot",), shared)
    minutes = (time.perf_counter() - began) / 60
    print(f"all of it took {minutes:.1f} minutes")
    if from_nothing:
        _note_minutes(config, len(seeds), minutes)


def _note_minutes(config: DictConfig, seeds: int, minutes: float) -> None:
    """Writes what all of it took from nothing into <results_dir>/assemble.csv, which the bench reads."""
    row = {
        "task": config.task.name,
        "seeds": seeds,
        "processes": config.processes,
        "minutes": round(minutes, 2),
    }
    append_rows(Path(config.results_dir) / "assemble.csv", [row], ("task", "seeds", "processes"))


def _chains(seed: str) -> list[list[Step]]:
    """T-STAR and its two controls, each followed by its evaluation."""
    return [
        [("tstar", seed), ("evaluate", "system=tstar", seed)],
        [
            ("policy_sequencing", seed),
            ("evaluate", "system=policy_sequencing", seed),
            ("evaluate", "system=no_finetuning", seed),
        ],
    ]


if __name__ == "__main__":
    main()
