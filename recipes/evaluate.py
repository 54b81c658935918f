"""How often a skill or a chain succeeds, on fresh seeds.

python recipes/evaluate.py system=tstar seed=0                 # or policy_sequencing, no_finetuning, ...
python recipes/evaluate.py system=gail_ppo subtask=2 seed=0
python recipes/evaluate.py path=runs/table_lack/tstar/seed1/last   # system, seed and subtask are the path's
python recipes/evaluate.py pretrained=table_lack               # a trained chain that comes with the package
"""

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

from tstar_rl.chaining.chain import chain_record
from tstar_rl.chaining.recovery import RecoveringChain
from tstar_rl.config.build import environment, load_skill
from tstar_rl.config.chain import check_links
from tstar_rl.config.load import recipe
from tstar_rl.config.pretrained import check_same_chain, take_pretrained
from tstar_rl.config.recovery import chain_policy
from tstar_rl.config.values import plain
from tstar_rl.config.worlds import check_world
from tstar_rl.launch.asked_checkpoints import Found, find_checkpoints, spent_on
from tstar_rl.launch.evaluations import check_evaluation
from tstar_rl.launch.run_folders import of_an_earlier_training, run_folder
from tstar_rl.rollouts.episodes import evaluate, same_policy
from tstar_rl.rollouts.recorder import Recorder
from tstar_rl.runs.csv_tables import append_rows, check_table, rows_stay
from tstar_rl.runs.files import turn_to_write
from tstar_rl.runs.run_config import note_evaluation
from tstar_rl.runs.run_folder import SPENT, is_untrained, run_path
from tstar_rl.seeds import evaluation_seed
from tstar_rl.shipped.chain import ShippedChain

KEY = ("checkpoint", "mode", "seed")
"""Of which there is one row in a table."""


class Candidate(NamedTuple):
    """What is evaluated: a policy, the subtask that it is of or how many it chains, and what its training took."""

    policy: nn.Module
    subtask: int | None
    links: int | None
    spent: Mapping[str, float]


@recipe(
    "evaluate", path=str | None, checkpoints=tuple[str, ...], modes=tuple[str, ...], video=bool,
    pretrained=str | None, pretrained_dir=str | None,
)  # fmt: skip
def main(config: DictConfig) -> None:
    """Evaluates, prints the table and adds it to evaluation.csv."""
    results, candidates = _candidates(config, HydraConfig.get().overrides.task)
    check_evaluation(results, plain(config))
    check_table(file := results / "evaluation.csv")
    rows, policies, films, film = [], {}, [], config.video and config.evaluation.recorded != 0
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
            films += [recorder] if film else []
            env.close()
            film = False  # the first checkpoint's first mode alone
    check_evaluation(results, plain(config))  # another one may have ended meanwhile
    _forget_older(file, config)
    # First: a table whose world nobody noted would pass for any.
    note_evaluation(results, plain(config), rows_stay(file, rows, KEY))
    print(append_rows(file, rows, KEY).round(3).to_string(index=False))
    print(file)
    with turn_to_write(results):
        for recorder in films:
            recorder.write(results)
    for policy in policies.values():
        if isinstance(policy, ShippedChain):
            print(*(policy.compare(row, plain(config)["env"]) for row in rows), sep="\n")


def _forget_older(table: Path, config: DictConfig) -> None:
    """Deletes a table of an earlier training, whose rows would stand beside the new ones."""
    if config.pretrained is not None or table.parent != run_folder(config, "results_dir"):
        return
    with turn_to_write(table.parent):  # another evaluation of this run may do the same
        if table.is_file() and of_an_earlier_training(table, config):
            print(f"{table} was of an earlier training: its rows are dropped")
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
    results, checkpoints = find_checkpoints(config, given)
    return results, {name: _trained(config, results, found) for name, found in checkpoints.items()}


def _trained(config: DictConfig, results: Path, found: Found) -> Candidate:
    """One skill, or a chain, in its own world."""
    for index, folder in enumerate(found.folders):
        skill = run_path(config.results_dir, config.task.name, config.skills, config.seed, index)
        check_world(config, folder, skill if is_untrained(config.system) else None)
    whole = chain_record(found.folders[0])  # one that a training replaces meanwhile is not read by halves
    skills = [load_skill(folder, task=config.task.name, chain=whole) for folder in found.folders]
    spent = spent_on(config, results, found)
    if not found.chain:
        return Candidate(skills[0].policy.to(config.device), skills[0].subtask, None, spent)
    check_links(config, len(skills))
    policy = chain_policy(config, skills, found.folders).to(config.device)
    return Candidate(policy, None, len(skills), spent)


if __name__ == "__main__":
    main()
