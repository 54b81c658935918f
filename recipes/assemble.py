"""The whole pipeline: demonstrations, skills, chaining three ways, evaluation, films, curves.

    python recipes/assemble.py scale=laptop seed=0        # or scale=quick; or several: seeds=[0,1,2]

What is given on the command line is passed on to every step. A step that is done is not run again; one that was killed
goes on from its last checkpoint. With launch=ray the steps run wherever a cluster has room.
"""

import itertools
import time
from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.load import recipe
from tstar_rl.config.overrides import key_of, section_of
from tstar_rl.launch.backends import launcher
from tstar_rl.launch.bonus import BONUS, with_bonus, with_some_bonus, without_bonus
from tstar_rl.launch.overrides import chosen_scale, passed_on
from tstar_rl.launch.side_by_side import Step, run_side_by_side
from tstar_rl.launch.steps import check_step, is_done, missing
from tstar_rl.runs.csv_tables import append_rows

OWN = ("processes", "seeds")  # values that only this recipe knows
OF_NO_MOMENT = {"task", "scale", "seed", "results_dir", "runs_dir", "demonstrations_dir", "progress_bar"}
"""Sections of values with which the minutes are still those of the scale."""


@recipe("assemble", processes=int, seeds=tuple[int, ...] | None)
def main(config: DictConfig) -> None:
    """Runs the steps, as many at a time as there are processes, where they do not wait for each other."""
    began = time.perf_counter()
    shared = passed_on(OWN)
    subtasks = [f"subtask={index}" for index in range(config.task.subtasks)]
    kinds = f"kinds=[{config.demonstrations.kind}]"
    if config.seeds is not None and any(key_of(value) == "seed" for value in shared):
        raise InvalidValueError(f"seeds says which seeds there are: leave out seed={config.seed}")
    seeds = list(config.seeds or [config.seed])
    run = launcher(config)
    made = (Path(folder) / config.task.name for folder in (config.runs_dir, config.demonstrations_dir))
    from_nothing = not any(folder.exists() for folder in made)  # else steps that are done take no time

    def bonus_known(step: Step) -> Step:
        return with_bonus(step, config.task.name, _seed(step), config.results_dir, config.runs_dir)

    def left(lane: list[Step]) -> list[Step]:
        """The steps that are not done; one whose bonus another is to find follows that one."""
        found: list[Step] = []
        for step in lane:
            waits = without_bonus(step) != step
            found += [step] if waits and found else missing([bonus_known(step)], shared)
        return found

    def at_once(lanes: list[list[Step]]) -> None:
        def one(step: Step, values: list[str], line: int) -> None:
            run(bonus_known(step), values, line)

        run_side_by_side([left(lane) for lane in lanes], shared, config.processes, one)

    skills = [(f"seed={seed}", one) for seed in seeds for one in subtasks]
    chains = [lane for seed in seeds for lane in _chains(f"seed={seed}", shared)]
    _check(chains, shared)
    at_once([[("make_demonstrations", *skill, kinds), ("gail_ppo", *skill)] for skill in skills])
    at_once([*chains, *([("evaluate", "system=gail_ppo", *skill)] for skill in skills)])
    run(("plot",), shared)
    minutes = (time.perf_counter() - began) / 60
    print(f"all of it took {minutes:.1f} minutes")
    of_the_scale = not {section_of(value) for value in shared} - OF_NO_MOMENT
    if from_nothing and of_the_scale and config.launch == "local":
        _note_minutes(config, chosen_scale(), len(seeds), minutes)


def _check(chains: list[list[Step]], shared: list[str]) -> None:
    """Tells a mistake in the values of a chain before its skills are trained, and a finished chain of other values."""
    for step in itertools.chain(*chains):
        if step[0] != "evaluate":
            check_step(with_some_bonus(step), shared)
            is_done(with_some_bonus(step), shared, ignored=("bonus",))


def _seed(step: Step) -> int:
    return next(int(value.removeprefix("seed=")) for value in step if value.startswith("seed="))


def _note_minutes(config: DictConfig, scale: str, seeds: int, minutes: float) -> None:
    """Writes what all of it took from nothing into <results_dir>/assemble.csv, which the bench reads."""
    row = {
        "task": config.task.name,
        "scale": scale,
        "seeds": seeds,
        "processes": config.processes,
        "minutes": round(minutes, 2),
    }
    append_rows(Path(config.results_dir) / "assemble.csv", [row], ("task", "scale", "seeds", "processes"))


def _chains(seed: str, shared: list[str]) -> list[list[Step]]:
    """T-STAR and its two controls, one of which needs what T-STAR paid; then their evaluations.

    What the command line says of terminal_reward is T-STAR's, and its controls do not read it.
    """
    plain = ["terminal_reward={score: terminal, baseline: none}"]
    if any(section_of(value) == "terminal_reward" and "momentum" in value for value in shared):
        plain.append(
            "++terminal_reward.momentum=0.01"
        )  # its default: Hydra keeps a key that the section leaves out
    bonus = ("system=policy_sequencing_bonus", seed)
    return [
        [
            ("tstar", seed),
            ("policy_sequencing", *bonus, *plain, f"{BONUS}tstar"),
            ("evaluate", "system=tstar", seed),
            ("evaluate", *bonus),
        ],
        [
            ("policy_sequencing", seed, *plain),
            ("evaluate", "system=policy_sequencing", seed),
            ("evaluate", "system=no_finetuning", seed),
        ],
    ]


if __name__ == "__main__":
    main()
