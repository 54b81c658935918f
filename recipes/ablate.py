"""Ablations: variants of fine-tuning the same skills, trained and evaluated beside each other.

    python recipes/ablate.py ablation=lambda_3 seed=0        # or ablation=[lambda_3,starts], or all=true

The variants are in configs/ablation/<name>.yaml. Demonstrations and skills are made where they are missing; what is
finished is not done again, and a variant that several ablations share is trained once. Tables land in
<results_dir>/<task>/ablations/<ablation>/<variant>/seed<k>/. What else is given on the command line is passed on.
"""

import shutil
from pathlib import Path
from typing import Any

import yaml
from hydra import compose
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.analysis import (
    ablation_figure,
    ablation_finding,
    ablation_table,
    load_ablation,
    save_figure,
)
from tstar_rl.analysis.variants import FOLDER, SKILLS, Variant, names, read
from tstar_rl.config.build import demonstrations_path
from tstar_rl.config.chain import chain_length
from tstar_rl.config.load import plain, recipe
from tstar_rl.launch.backends import launcher
from tstar_rl.launch.side_by_side import Step, mean_bonus, run_side_by_side
from tstar_rl.rollouts.starts import check_shares
from tstar_rl.runs.checkpoint import differences
from tstar_rl.runs.run import MACHINE_ONLY
from tstar_rl.runs.run_folder import run_path

OWN = ("ablation", "all", "variants", "processes")  # values that only this recipe knows
EVALUATION = ("modes=[deterministic]", "checkpoints=[last]", "video=false")
CHAINING = (
    "chain",
    "terminal_reward",
    "d_omega",
    "skills",
)  # sections that a skill's own training does not read
TABLES = ("config.yaml", "metrics.csv", "evaluation.csv")


@recipe("ablate", ablation=dict[str, Any] | None, all=bool, variants=tuple[str, ...] | None, processes=int)
def main(config: DictConfig) -> None:
    """Makes the skills, then every variant, those that wait for another's mean bonus last."""
    given = HydraConfig.get().overrides.task
    shared = [value for value in given if value.split("=")[0].lstrip("+") not in OWN]
    shared.insert(0, f"scale={HydraConfig.get().runtime.choices['scale']}")
    chosen = names() if config.all else sorted(config.get("ablation") or ())
    if not chosen:
        raise SystemExit(f"say which: ablation=<name> or all=true; there are {', '.join(names())}")
    variants = [variant for name in chosen for variant in _chosen(config, name)]
    firsts = {variant.first(): None for variant in variants}
    sources = {first.source().first(): None for first in firsts if first.bonus_of}
    runs = list({**sources, **firsts})
    for index in range(config.task.subtasks):
        skill = plain(compose("recipe/gail_ppo", [*shared, f"system={SKILLS}", f"subtask={index}"]))
        wanted = {name: value for name, value in skill.items() if name not in CHAINING}
        _check_finished(config, wanted, SKILLS, index)
    for run in runs:
        _check(config, run, shared)

    launch = launcher(config)
    run_side_by_side(_skill_lanes(config), shared, config.processes, launch)
    for wait in (False, True):
        lanes = [_lane(config, run) for run in runs if bool(run.bonus_of) is wait]
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


def _place(config: DictConfig, root: str, system: str, subtask: int | None = None) -> Path:
    return run_path(config[root], config.task.name, system, config.seed, subtask)


def _check(config: DictConfig, run: Variant, shared: list[str]) -> None:
    """Composes a variant's configs before anything is run, and compares a finished one with its own."""
    chain_length(compose("recipe/evaluate", [*shared, *run.overrides]))
    if run.trains:
        wanted = plain(compose(f"recipe/{run.system}", [*shared, *_values(run)]))
        check_shares(wanted["chain"]["starts"])
        _check_finished(config, wanted, run.place)


def _check_finished(
    config: DictConfig, wanted: dict[str, Any], system: str, subtask: int | None = None
) -> None:
    """Compares what is wanted with the config of a finished run.

    Raises:
        SystemExit: if it was finished with other values.
    """
    kept = _place(config, "results_dir", system, subtask) / "config.yaml"
    if _finished(config, system, subtask) and kept.is_file():
        saved = yaml.safe_load(kept.read_text())
        names = [name for name in wanted if name in saved and name not in (*MACHINE_ONLY, "bonus")]
        wrong = differences({name: saved[name] for name in names}, {name: wanted[name] for name in names})
        if wrong:
            raise SystemExit(f"{kept.parent}: {'; '.join(wrong)} (resume=false starts over)")


def _values(run: Variant) -> list[str]:
    return [f"system={run.place}", f"skills={SKILLS}", *run.overrides]


def _finished(config: DictConfig, system: str, subtask: int | None = None) -> bool:
    done = _place(config, "runs_dir", system, subtask) / "finished.json"
    return config.resume and done.is_file()


def _evaluated(config: DictConfig, system: str, subtask: int | None = None) -> bool:
    """Whether there is an evaluation, newer than the training if there was one."""
    table = _place(config, "results_dir", system, subtask) / "evaluation.csv"
    trained = _place(config, "runs_dir", system, subtask) / "finished.json"
    if not (config.resume and table.is_file()):
        return False
    return not trained.is_file() or table.stat().st_mtime >= trained.stat().st_mtime


def _skill_lanes(config: DictConfig) -> list[list[Step]]:
    """What is missing of demonstrations, skills and their evaluations, a lane for each subtask."""
    lanes: list[list[Step]] = []
    for index in range(config.task.subtasks):
        one, lane, kind = f"subtask={index}", [], config.demonstrations.kind
        if not (config.resume and demonstrations_path(config, index, kind).is_file()):
            lane.append(("make_demonstrations", one, f"kinds=[{kind}]"))
        if not _finished(config, SKILLS, index):
            lane.append(("gail_ppo", one, f"system={SKILLS}"))
        if lane or not _evaluated(config, SKILLS, index):
            lane.append(("evaluate", one, f"system={SKILLS}", *EVALUATION))
        lanes.append(lane)
    return lanes


def _lane(config: DictConfig, run: Variant) -> list[Step]:
    """What is missing of a variant: training, then evaluation."""
    lane: list[Step] = []
    if run.trains and not _finished(config, run.place):
        values, source = _values(run), run.source()
        if source is not None:
            metrics = _place(config, "results_dir", source.first().place) / "metrics.csv"
            values.append(f"bonus={mean_bonus(metrics)}")
        lane.append((run.system, *values))
    if lane or not _evaluated(config, run.place):
        lane.append(("evaluate", *_values(run), *EVALUATION))
    return lane


def _share(config: DictConfig, variant: Variant) -> None:
    """Gives a variant the tables of the one that was run for it."""
    source, target = (_place(config, "results_dir", each.place) for each in (variant.first(), variant))
    if source == target:
        return
    target.mkdir(parents=True, exist_ok=True)
    for name in TABLES:
        if (source / name).is_file():
            shutil.copyfile(source / name, target / name)


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
