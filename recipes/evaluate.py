"""How often a skill or a chain succeeds, on fresh seeds.

python recipes/evaluate.py system=tstar seed=0                 # or policy_sequencing, no_finetuning, ...
python recipes/evaluate.py system=gail_ppo subtask=2 seed=0
python recipes/evaluate.py path=runs/table_lack/tstar/seed1/last   # system, seed and subtask are the path's
python recipes/evaluate.py pretrained=table_lack               # a trained chain that comes with the package
"""

import json
import math
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from tensordict import TensorDictBase
from torch import nn
from tqdm import tqdm

from tstar_rl.chaining.chain import chain_folders
from tstar_rl.chaining.recovery import RecoveringChain
from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.build import environment, load_skill
from tstar_rl.config.chain import check_links
from tstar_rl.config.load import recipe
from tstar_rl.config.pretrained import check_same_chain, take_pretrained
from tstar_rl.config.recovery import chain_policy
from tstar_rl.config.values import plain
from tstar_rl.launch.evaluations import check_evaluation
from tstar_rl.launch.run_folders import begun_with, ended_since, evaluated_runs, run_folder
from tstar_rl.rollouts.episodes import evaluate, same_policy
from tstar_rl.rollouts.recorder import Recorder
from tstar_rl.runs.checkpoint import is_checkpoint
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.runs.run_config import note_evaluation
from tstar_rl.runs.run_folder import FINISHED, is_untrained, made_by, read_run_path, run_path
from tstar_rl.seeds import evaluation_seed
from tstar_rl.shipped.chain import ShippedChain

SPENT = ("env_steps", "minutes")


class Candidate(NamedTuple):
    """What is evaluated: a policy, the subtask that it is of or how many it chains, and what its training took."""

    policy: nn.Module
    subtask: int | None
    links: int | None
    spent: Mapping[str, float]


class Found(NamedTuple):
    """Where the skills of a checkpoint lie, in order, and whether they are a chain: one of one skill is one, too."""

    folders: list[Path]
    chain: bool


@recipe(
    "evaluate", path=str | None, checkpoints=tuple[str, ...], modes=tuple[str, ...], video=bool,
    pretrained=str | None, pretrained_dir=str | None,
)  # fmt: skip
def main(config: DictConfig) -> None:
    """Evaluates, prints the table and adds it to evaluation.csv."""
    results, candidates = _candidates(config, HydraConfig.get().overrides.task)
    check_evaluation(results, plain(config))
    rows, policies, film = [], {}, config.video and config.evaluation.recorded != 0
    for name, (policy, subtask, links, spent) in candidates.items():
        number = config.evaluation.episodes if subtask is not None else config.evaluation.whole_episodes
        same = next((other for other, known in policies.items() if same_policy(policy, known)), None)
        if same is not None:  # the last is often the best: the same episodes would give the same numbers
            rows += [{**row, "checkpoint": name, **spent} for row in rows if row["checkpoint"] == same]
            continue
        policies[name] = policy
        for mode in config.modes:
            seed = evaluation_seed(config.seed, mode, subtask)
            torch.manual_seed(seed)
            env = environment(config, subtask, number, seed, snapshots=film)
            recorder = Recorder(env.base_env, config.evaluation.recorded if film else 0, enough=links)
            told = f"{name}, {mode}: {number} episodes of at most {env.base_env.max_steps} steps"
            with tqdm(desc=told, unit=" steps", disable=not config.progress_bar) as bar:
                row = evaluate(policy, env, mode, partial(_step, recorder, bar), links=links)
            if isinstance(policy, RecoveringChain):
                row["homings"] = float(policy.homings.double().mean())
            rows.append({"checkpoint": name, "mode": mode, **row, **spent, "seed": config.seed})
            recorder.write(results)
            env.close()
            film = False  # the first checkpoint's first mode alone
    _forget_older(results / "evaluation.csv", config)
    note_evaluation(results, plain(config))  # first: a table whose world nobody noted would pass for any
    table = append_rows(results / "evaluation.csv", rows, ("checkpoint", "mode", "seed"))
    print(table.round(3).to_string(index=False))
    print(results / "evaluation.csv")
    for policy in policies.values():
        if isinstance(policy, ShippedChain):
            print(*(policy.compare(row, plain(config)["env"]) for row in rows), sep="\n")


def _forget_older(table: Path, config: DictConfig) -> None:
    """Deletes a table of an earlier training, whose rows would stand beside the new ones."""
    of_a_run = config.pretrained is None and table.parent == run_folder(config, "results_dir")
    if of_a_run and table.is_file() and ended_since(table, evaluated_runs(config)):
        table.unlink()


def _step(recorder: Recorder, bar: tqdm, tensordict: TensorDictBase) -> None:
    recorder(tensordict)
    bar.update()


def _candidates(config: DictConfig, given: Iterable[str]) -> tuple[Path, dict[str, Candidate]]:
    """The folder of the table, and what is evaluated, by the name of its checkpoint; the config is completed."""
    if config.pretrained is not None:
        chain = take_pretrained(config, given)
        figures = next(iter(chain.record["figures"].values()))
        spent = {name: figures.get(name, math.nan) for name in SPENT}
        one = Candidate(chain.to(config.device), None, len(chain.policies), spent)
        check_same_chain(results := run_folder(config, "results_dir"), config)
        return results, {chain.record["checkpoint"]: one}
    results, checkpoints = _places(config, given)
    skills, _ = begun_with(results, config)
    return results, {name: _trained(config, skills, found) for name, found in checkpoints.items()}


def _trained(config: DictConfig, begun_with: str, found: Found) -> Candidate:
    """One skill, or a chain."""
    skills = [load_skill(folder, task=config.task.name) for folder in found.folders]
    spent = _spent(config, begun_with, found)
    if not found.chain:
        return Candidate(skills[0].policy.to(config.device), skills[0].subtask, None, spent)
    check_links(config, len(skills))
    policy = chain_policy(config, skills, found.folders).to(config.device)
    return Candidate(policy, None, len(skills), spent)


def _places(config: DictConfig, given: Iterable[str]) -> tuple[Path, dict[str, Found]]:
    """The folder of the table, and what each checkpoint found is.

    Args:
        config: its system, seed and subtask become those of config.path, where that is a run's.
        given: the values of the command line.
    """
    after = _take_from_path(config, given)
    results, names, chained = run_folder(config, "results_dir"), list(config.checkpoints), False
    if after is None or after.parts:  # a checkpoint, not a run
        path = Path(config.path)
        _check_checkpoints(config, given)
        homes, names = [path.parent], [path.name]
        results = path.parent if after is None else results / after.parent
    else:
        homes, chained = evaluated_runs(config), is_untrained(config.system)
    found = {name: _found([home / name for home in homes], chained) for name in names}
    complete = {name: one for name, one in found.items() if one is not None}
    if not complete:
        places = " or ".join(str(homes[0] / name) for name in names)
        raise MissingFileError(f"no skill and no chain at {places}{made_by(homes[0])}")
    return results, complete


def _found(places: list[Path], chained: bool) -> Found | None:
    """What is saved there: one skill each, `chained` as they are or one alone, or a chain; None: not all is there."""
    if all(map(is_checkpoint, places)):
        return Found(places, chained)
    folders = chain_folders(places[0]) if len(places) == 1 else []
    return Found(folders, True) if folders else None


def _keys(given: Iterable[str]) -> set[str]:
    """The keys of values of the command line."""
    return {value.lstrip("+~").split("=")[0] for value in given}


def _check_checkpoints(config: DictConfig, given: Iterable[str]) -> None:
    """Raises InvalidValueError if other checkpoints are asked for than the one that config.path is."""
    name = Path(config.path).name
    if "checkpoints" in _keys(given) and list(config.checkpoints) != [name]:
        raise InvalidValueError(
            f"path={config.path} is one checkpoint: leave out checkpoints, got {list(config.checkpoints)}; or give the "
            "folder of the run as the path"
        )


def _take_from_path(config: DictConfig, given: Iterable[str]) -> Path | None:
    """Sets system, seed and subtask to those of the run that config.path is of; returns what follows the run's folder.

    That is nothing for the run itself, also where no path is asked for. None: the path is of no run.

    Raises:
        ValueError: if the run is of another task, or is not what the command line asks for.
    """
    if config.path is None:
        return Path()
    path = Path(config.path).resolve()
    roots = [Path(config[name]).resolve() for name in ("results_dir", "runs_dir")]
    around = [root for root in roots if path.is_relative_to(root)]
    if not around:
        return None
    root = max(around, key=lambda one: len(one.parts))  # one of them may lie in the other
    place, after = read_run_path(path.relative_to(root))
    names = _keys(given) & {"system", "seed", "subtask"}
    asked = {"task": config.task.name, **{name: config[name] for name in sorted(names)}}
    for name, value in asked.items():
        found = getattr(place, name)
        if value != found:
            raise InvalidValueError(
                f"path={config.path} is of {name}={found}, but {name}={value} is asked for"
            )
    config.system, config.seed, config.subtask = place.system, place.seed, place.subtask
    return after


def _spent(config: DictConfig, begun_with: str, found: Found) -> dict[str, float]:
    """Environment steps and minutes that went into the skills, training and fine-tuning together.

    They are nan where a run has not ended. The best checkpoint cost what the last one did: its whole run was needed to
    tell that it is the best.
    """
    runs = {folder.parents[1 if folder.name.startswith("skill") else 0] for folder in found.folders}
    if found.chain:
        task, seed = config.task.name, config.seed
        runs |= {run_path(config.runs_dir, task, begun_with, seed, i) for i in range(len(found.folders))}
    files = [run / FINISHED for run in runs]
    if not all(file.is_file() for file in files):
        return dict.fromkeys(SPENT, math.nan)
    spent = [json.loads(file.read_text()) for file in files]
    return {name: sum(one[name] for one in spent) for name in SPENT}


if __name__ == "__main__":
    main()
