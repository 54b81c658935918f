"""How often a skill or a chain succeeds, on fresh seeds.

python recipes/evaluate.py system=tstar seed=0                 # or policy_sequencing, no_finetuning, ...
python recipes/evaluate.py system=gail_ppo subtask=2 seed=0
python recipes/evaluate.py path=runs/table_lack/tstar/seed0/last
"""

import itertools
import json
import math
from pathlib import Path

import torch
from omegaconf import DictConfig
from torchrl.checkpoint import Checkpoint

from tstar_rl.chain import ChainPolicy, chain_folders
from tstar_rl.collection import derive_seed
from tstar_rl.configuration import chain_length, environment, recipe
from tstar_rl.csv_tables import append_rows
from tstar_rl.evaluation import MODES, Recorder, check_modes, evaluate, same_policy
from tstar_rl.logging import run_path
from tstar_rl.skill_agent import load_skill


@recipe("evaluate", path=str | None, checkpoints=tuple[str, ...], modes=tuple[str, ...], video=bool)
def main(config: DictConfig) -> None:
    """Evaluates, prints the table and adds it to evaluation.csv."""
    check_modes(config.modes)
    results, checkpoints = _places(config)
    rows, policies, film = [], {}, config.video
    for name, folders in checkpoints.items():
        skills = [load_skill(folder, task=config.task.name) for folder in folders]
        chain = len(skills) > 1
        subtask = None if chain else skills[0].subtask
        policy = (ChainPolicy(skills) if chain else skills[0].policy).to(config.device)
        number = config.evaluation.episodes if subtask is not None else config.evaluation.whole_episodes
        spent = _spent(config, folders, chain)
        same = next((other for other, known in policies.items() if same_policy(policy, known)), None)
        if same is not None:  # the last is often the best: the same episodes would give the same numbers
            rows += [{**row, "checkpoint": name, **spent} for row in rows if row["checkpoint"] == same]
            continue
        policies[name] = policy
        for mode in config.modes:
            seed = derive_seed(config.seed, "evaluate", list(MODES).index(mode), subtask)
            torch.manual_seed(seed)
            env = environment(config, subtask, number, seed, snapshots=film)
            recorder = Recorder(env.base_env, min(config.evaluation.recorded, number) if film else 0)
            row = evaluate(policy, env, mode, recorder, links=len(skills) if chain else None)
            rows.append({"checkpoint": name, "mode": mode, **row, **spent, "seed": config.seed})
            recorder.write(results)
            film = False  # the first checkpoint's first mode alone
    table = append_rows(results / "evaluation.csv", rows, ("checkpoint", "mode", "seed"))
    print(table.round(3).to_string(index=False))
    print(results / "evaluation.csv")


def _places(config: DictConfig) -> tuple[Path, dict[str, list[Path]]]:
    """Where the table goes; and of each checkpoint that there is, the folders of its skills in order."""
    task, seed, names = config.task.name, config.seed, list(config.checkpoints)
    results = run_path(config.results_dir, task, config.system, seed, config.subtask)
    homes = [run_path(config.runs_dir, task, config.system, seed, config.subtask)]
    if config.path is not None:
        path = Path(config.path)
        homes, names = [path.parent], [path.name]
        if path.parts[0] == Path(config.results_dir).name:  # a results folder: its skills lie beside it
            homes, names = [Path(config.runs_dir, *path.parts[1:])], list(config.checkpoints)
        home, runs = homes[0].absolute(), Path(config.runs_dir).absolute()
        results = Path(config.results_dir, home.relative_to(runs)) if home.is_relative_to(runs) else home
    elif Path(config.system).name.startswith("no_finetuning"):
        homes = [run_path(config.runs_dir, task, config.skills, seed, i) for i in range(chain_length(config))]
    found = {name: [_skills(home / name) for home in homes] for name in names}
    complete = {name: [*itertools.chain(*parts)] for name, parts in found.items() if all(parts)}
    if not complete:
        raise FileNotFoundError(f"no skill and no chain at {homes[0]}/{{{','.join(names)}}}")
    return results, complete


def _skills(place: Path) -> list[Path]:
    """The folder of the one skill saved at `place`, or of each skill of the chain saved there."""
    return [place] if Checkpoint.is_checkpoint(place) else chain_folders(place)


def _spent(config: DictConfig, folders: list[Path], chain: bool) -> dict[str, float]:
    """Environment steps and minutes that went into the skills, training and fine-tuning together.

    They are nan where a run has not ended. The best checkpoint cost what the last one did: its whole run was needed to
    tell that it is the best.
    """
    runs = {folder.parents[1 if folder.name.startswith("skill") else 0] for folder in folders}
    if chain:
        task, seed = config.task.name, config.seed
        runs |= {run_path(config.runs_dir, task, config.skills, seed, i) for i in range(len(folders))}
    files = [run / "finished.json" for run in runs]
    if not all(file.is_file() for file in files):
        return {"env_steps": math.nan, "minutes": math.nan}
    spent = [json.loads(file.read_text()) for file in files]
    return {name: sum(one[name] for one in spent) for name in ("env_steps", "minutes")}


if __name__ == "__main__":
    main()
