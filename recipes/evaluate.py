"""How often a skill or a chain succeeds, on fresh seeds.

python recipes/evaluate.py system=tstar seed=0                 # or policy_sequencing, no_finetuning, ...
python recipes/evaluate.py system=gail_ppo subtask=2 seed=0
python recipes/evaluate.py path=runs/table_lack/tstar/seed0/last
"""

import json
from pathlib import Path

import torch
from omegaconf import DictConfig
from torchrl.checkpoint import Checkpoint

from tstar_rl.chain import ChainPolicy
from tstar_rl.collection import derive_seed
from tstar_rl.configuration import environment, recipe
from tstar_rl.evaluation import MODES, Recorder, evaluate
from tstar_rl.logging import append_rows, run_path
from tstar_rl.skill import Skill


@recipe("evaluate")
def main(config: DictConfig) -> None:
    """Evaluates, prints the table and adds it to evaluation.csv."""
    results, folders, name = _places(config)
    skills = [Skill.load(folder, task=config.task.name) for folder in folders]
    whole = len(skills) > 1
    subtask = None if whole else skills[0].subtask
    policy = ChainPolicy(skills) if whole else skills[0].policy
    number = config.evaluation.whole_episodes if whole else config.evaluation.episodes
    recorded = min(config.evaluation.recorded, number) if config.video else 0
    rows = []
    for mode in config.modes:
        seed = derive_seed(config.seed, "evaluate", list(MODES).index(mode), subtask)
        torch.manual_seed(seed)
        env = environment(config, subtask, number, seed, snapshots=recorded > 0)
        recorder = Recorder(env.base_env, recorded if mode == config.modes[0] else 0)
        row = evaluate(policy, env, mode, recorder)
        spent = _spent(config, folders, whole)
        rows.append({"checkpoint": name, "mode": mode, **row, **spent, "seed": config.seed})
        recorder.write(results)
    table = append_rows(results / "evaluation.csv", rows, ("checkpoint", "mode", "seed"))
    print(table.round(3).to_string(index=False))
    print(results / "evaluation.csv")


def _places(config: DictConfig) -> tuple[Path, list[Path], str]:
    """Where the table goes, the folders of the skills in order, and the name of the checkpoint."""
    task, seed, name = config.task.name, config.seed, config.checkpoint
    if config.path is not None:
        path = Path(config.path)
        if path.parts[0] == Path(config.results_dir).name:  # a results folder: its skills lie beside it
            path = Path(config.runs_dir, *path.parts[1:], name)
        found = [path] if Checkpoint.is_checkpoint(path) else sorted(path.glob("skill*"))
        if not found:
            raise FileNotFoundError(f"no skill and no chain at {path}")
        home, runs = path.parent.absolute(), Path(config.runs_dir).absolute()
        kept = Path(config.results_dir, home.relative_to(runs)) if home.is_relative_to(runs) else home
        return kept, found, path.name
    results = run_path(config.results_dir, task, config.system, seed, config.subtask)
    if config.subtask is not None:
        return results, [run_path(config.runs_dir, task, config.system, seed, config.subtask) / name], name
    if config.system == "no_finetuning":
        runs = [run_path(config.runs_dir, task, "gail_ppo", seed, i) for i in range(config.task.subtasks)]
        return results, [run / name for run in runs], name
    run = run_path(config.runs_dir, task, config.system, seed)
    if Checkpoint.is_checkpoint(run / name):
        return results, [run / name], name
    return results, [run / name / f"skill{i}" for i in range(config.task.subtasks)], name


def _spent(config: DictConfig, folders: list[Path], whole: bool) -> dict[str, float]:
    """Environment steps and minutes that went into the skills, training and fine-tuning together."""
    runs = {folder.parent if folder.parent.name != "last" else folder.parent.parent for folder in folders}
    if whole:
        task, seed = config.task.name, config.seed
        runs |= {run_path(config.runs_dir, task, "gail_ppo", seed, i) for i in range(len(folders))}
    files = [run / "finished.json" for run in runs if (run / "finished.json").is_file()]
    spent = [json.loads(file.read_text()) for file in files]
    return {name: sum(one[name] for one in spent) for name in ("env_steps", "minutes")}


if __name__ == "__main__":
    main()
