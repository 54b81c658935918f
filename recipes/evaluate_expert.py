"""How often the scripted assembler succeeds, a subtask and the whole task: what every learned policy is held against.

python recipes/evaluate_expert.py task=table_lack seed=0          # env.velocity_scale=1.0, env.preassembled=ideal, ...
"""

from pathlib import Path

import torch
from omegaconf import DictConfig

from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.values import plain
from tstar_rl.launch.evaluations import check_evaluation
from tstar_rl.rollouts.episodes import evaluate
from tstar_rl.rollouts.recorder import Recorder
from tstar_rl.runs.csv_tables import append_rows, check_table
from tstar_rl.runs.run_config import note_evaluation
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seeds import evaluation_seed


@recipe("evaluate_expert", video=bool)
def main(config: DictConfig) -> None:
    """Evaluates the whole task and each subtask, or the one asked for; adds rows to their evaluation.csv."""
    asked = [None, *range(config.task.subtasks)] if config.subtask is None else [config.subtask]
    for subtask in asked:
        results = run_path(config.results_dir, config.task.name, config.system, config.seed, subtask)
        check_evaluation(results, plain(config))
        check_table(results / "evaluation.csv")
        number = config.evaluation.whole_episodes if subtask is None else config.evaluation.episodes
        seed = evaluation_seed(config.seed, "deterministic", subtask)
        torch.manual_seed(seed)
        recorded = config.evaluation.recorded if config.video else 0
        env = environment(config, subtask, number, seed, snapshots=recorded != 0)
        recorder = Recorder(env.base_env, recorded)
        row = evaluate(env.base_env.expert(), env, each_step=recorder)
        spent = {"env_steps": 0, "minutes": 0.0, "seed": config.seed}
        note_evaluation(results, {**plain(config), "subtask": subtask})
        _write(results, {"checkpoint": "script", "mode": "deterministic", **row, **spent})
        recorder.write(results)
        env.close()


def _write(results: Path, row: dict) -> None:
    table = append_rows(results / "evaluation.csv", [row], ("checkpoint", "mode", "seed"))
    print(table.round(3).to_string(index=False))
    print(results / "evaluation.csv")


if __name__ == "__main__":
    main()
