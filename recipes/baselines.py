"""The baselines of one policy for the whole task: demonstrations, BC twice, PPO, GAIL, GAIL+PPO, evaluation.

    python recipes/baselines.py task=table_lack seed=0          # scale=whole; scale=whole_quick for a look

What is given on the command line is passed on to every step. A baseline that is evaluated is not made again; a training
that was killed goes on from its last checkpoint. Tables land in <results_dir>/<task>/<baseline>/seed<k>/.
"""

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError, did_you_mean
from tstar_rl.config.load import recipe
from tstar_rl.launch.backends import launcher
from tstar_rl.launch.overrides import chosen_scale, passed_on
from tstar_rl.launch.side_by_side import Step, run_side_by_side
from tstar_rl.launch.steps import missing

OWN = ("processes", "systems", "only", "subtask", "video")  # values that only this recipe knows


@recipe(
    "baselines", processes=int, video=bool, only=tuple[str, ...] | None, systems=dict[str, tuple[str, ...]]
)
def main(config: DictConfig) -> None:
    """Trains and evaluates those that are missing, some at a time."""
    shared = [f"scale={chosen_scale()}", *passed_on((*OWN, "scale"))]
    if unknown := [system for system in config.only or () if system not in config.systems]:
        near = did_you_mean(unknown[0], config.systems)
        raise InvalidValueError(
            f"only must name some of {', '.join(config.systems)}, got {', '.join(unknown)}{near}"
        )
    if nameless := [system for system, steps in config.systems.items() if not steps]:
        raise InvalidValueError(f"systems.{nameless[0]} must name its recipe first, got none")
    lanes = [missing(_lane(config, system), shared) for system in config.only or config.systems]
    if any(lanes):
        run = launcher(config)
        run(("make_demonstrations", "whole=true"), shared)
        run_side_by_side(lanes, shared, config.processes, run)


def _lane(config: DictConfig, system: str) -> list[Step]:
    """The steps of one baseline."""
    name, *own = config.systems[system]
    return [(name, f"system={system}", *own), ("evaluate", f"system={system}", f"video={config.video}")]


if __name__ == "__main__":
    main()
