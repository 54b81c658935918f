"""Ablations: variants of fine-tuning the same skills, trained and evaluated beside each other.

    python recipes/ablate.py ablation=lambda_3 seed=0        # or ablation=[lambda_3,starts], or all=true

The variants are in configs/ablation/<name>.yaml. Demonstrations and skills are made where they are missing; what is
finished is not done again, and a variant that several ablations share is trained once. Tables land in
<results_dir>/<task>/ablations/<ablation>/<variant>/seed<k>/. What else is given on the command line is passed on.
"""

import shutil
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from tstar_rl.analysis import (
    ablation_figure,
    ablation_finding,
    ablation_table,
    load_ablation,
    save_figure,
)
from tstar_rl.analysis.variants import FOLDER, SKILLS, Variant, names, read
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.load import recipe
from tstar_rl.config.overrides import known_to
from tstar_rl.config.ranges import chain_length
from tstar_rl.config.values import plain
from tstar_rl.launch.backends import launcher
from tstar_rl.launch.bonus import BONUS, mean_bonus, with_some_bonus
from tstar_rl.launch.overrides import chosen_scale, passed_on
from tstar_rl.launch.side_by_side import Step, run_side_by_side
from tstar_rl.launch.steps import check_step, is_done, missing, step_config
from tstar_rl.runs.files import replacing
from tstar_rl.runs.run_folder import run_path

OWN = ("ablation", "all", "variants", "processes")  # values that only this recipe knows
EVALUATION = ("modes=[deterministic]", "checkpoints=[last]", "video=false")
UNKNOWN = ("bonus",)  # of a variant that pays what another paid, until that one is trained
TABLES = ("config.yaml", "metrics.csv", "evaluation.csv")


@recipe("ablate", ablation=dict[str, Any] | None, all=bool, variants=tuple[str, ...] | None, processes=int)
def main(config: DictConfig) -> None:
    """Makes the skills, then every variant, those that wait for another's mean bonus last."""
    shared = passed_on(OWN)
    shared.insert(0, f"scale={chosen_scale()}")
    chosen = names() if config.all else sorted(config.get("ablation") or ())
    if not chosen:
        raise InvalidValueError(f"say which: ablation=<name> or all=true; there are {', '.join(names())}")
    variants = [variant for name in chosen for variant in _chosen(config, name)]
    firsts = {variant.first(): None for variant in variants}
    sources = {first.source().first(): None for first in firsts if first.bonus_of}
    runs = list({**sources, **firsts})
    skills = _skill_lanes(config, shared)
    for run in runs:
        _check(run, shared)

    launch = launcher(config)
    run_side_by_side(skills, shared, config.processes, launch)
    for wait in (False, True):
        lanes = [_lane(config, run, shared) for run in runs if bool(run.bonus_of) is wait]
        run_side_by_side(lanes, shared, config.processes, launch)
    for variant in variants:
        _share(config, variant)
    for name in chosen:
        _show(config, name)


def _chosen(config: DictConfig, name: str) -> list[Variant]:
    """The variants of an ablation that are asked for."""
    found = read(name)
    return (
        list(found.variants) if config.variants is None else [found.variant(one) for one in config.variants]
    )


def _place(config: DictConfig, system: str) -> Path:
    return run_path(config.results_dir, config.task.name, system, config.seed)


def _check(run: Variant, shared: list[str]) -> None:
    """Checks a variant's values before anything is run, and compares a finished one with its own."""
    chain_length(step_config(("evaluate", *_of_evaluation(run, shared)), shared))
    if run.trains:
        step = (run.system, *_values(run))
        waits = (f"{BONUS}{run.bonus_of}",) if run.bonus_of else ()
        check_step(with_some_bonus((*step, *waits)), shared)
        is_done(step, shared, UNKNOWN)


def _values(run: Variant) -> list[str]:
    return [f"system={run.place}", f"skills={SKILLS}", *run.overrides]


def _of_evaluation(run: Variant, shared: list[str]) -> tuple[str, ...]:
    """A variant's overrides without those that are a recipe's own: an evaluation has no such values."""
    return known_to(plain(step_config(("evaluate",), shared)), run.overrides)


def _skill_lanes(config: DictConfig, shared: list[str]) -> list[list[Step]]:
    """What is missing of demonstrations, skills and their evaluations, a lane for each subtask."""
    lanes = []
    for one in (f"subtask={index}" for index in range(config.task.subtasks)):
        system = f"system={SKILLS}"
        demonstrations = ("make_demonstrations", one, f"kinds=[{config.demonstrations.kind}]")
        steps = [demonstrations, ("gail_ppo", one, system), ("evaluate", one, system, *EVALUATION)]
        lanes.append(missing(steps, shared))
    return lanes


def _lane(config: DictConfig, run: Variant, shared: list[str]) -> list[Step]:
    """What is missing of a variant: training, then evaluation."""
    lane: list[Step] = []
    training, source = (run.system, *_values(run)), run.source()
    if run.trains and not is_done(training, shared, UNKNOWN):
        if source is not None:
            metrics = _place(config, source.first().place) / "metrics.csv"
            training = (*training, f"bonus={mean_bonus(metrics)}")
        lane.append(training)
    values = (f"system={run.place}", f"skills={SKILLS}", *_of_evaluation(run, shared))
    return [*lane, *missing([("evaluate", *values, *EVALUATION)], shared)]


def _share(config: DictConfig, variant: Variant) -> None:
    """Gives a variant the tables of the one that was run for it."""
    source, target = (_place(config, each.place) for each in (variant.first(), variant))
    if source == target:
        return
    target.mkdir(parents=True, exist_ok=True)
    for name in TABLES:
        if (source / name).is_file():
            with replacing(target / name) as partial:
                shutil.copyfile(source / name, partial)


def _show(config: DictConfig, name: str) -> None:
    """Prints an ablation's table and what it shows, and draws it beside its results."""
    rows = load_ablation(name, config.results_dir)
    rows = rows[rows.task == config.task.name]
    print(ablation_table(rows).round(3).to_string())
    print(ablation_finding(rows))
    path = Path(config.results_dir) / config.task.name / FOLDER / name / "ablation.png"
    print(save_figure(ablation_figure(rows), path))


if __name__ == "__main__":
    main()
