"""How often the scripted assembler does every piece on the shelf: each subtask, and the whole piece.

python recipes/evaluate_shelf.py                              # all pieces; tasks=[toy_table,chair_agne]: these alone

Fresh episodes with start noise, earlier steps preassembled as `env.preassembled` says. Rows of one piece and seed
replace those of the same piece and seed in <results_dir>/shelf_scripted.csv.
"""

from pathlib import Path
from typing import Any

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.overrides import section_of
from tstar_rl.config.values import CONFIGS, task_section
from tstar_rl.rollouts.episodes import evaluate
from tstar_rl.runs.csv_tables import append_rows, check_table
from tstar_rl.seeds import evaluation_seed

WHOLE = "whole"
KEPT = ("success", "success_low", "success_high", "progress", "episode_length")


@recipe("evaluate_shelf", tasks=tuple[str, ...] | None)
def main(config: DictConfig) -> None:
    """Evaluates every piece in turn and prints the table as it grows."""
    given = HydraConfig.get().overrides.task
    if one := [value for value in given if section_of(value) in ("task", "subtask")]:
        raise InvalidValueError(
            f"evaluate_shelf tries every subtask of tasks=[...], all pieces where none is named; got {one[0]}"
        )
    path = Path(config.results_dir) / "shelf_scripted.csv"
    check_table(path)
    tasks = config.tasks or sorted(file.stem for file in (CONFIGS / "task").glob("*.yaml"))
    sections = {task: task_section(task) for task in tasks}  # a name that is none is told first
    for task, values in sections.items():
        rows = _rows(OmegaConf.merge(config, {"task": values}))  # pyright: ignore[reportArgumentType]
        table = append_rows(path, rows, ("task", "subtask", "seed"))
        print(table[table.task == task].round(3).to_string(index=False), flush=True)
    print(path)


def _rows(config: DictConfig) -> list[dict[str, Any]]:
    """A row for each subtask of a piece, and one for the whole of it."""
    rows = []
    for subtask in [*range(config.task.subtasks), None]:
        number = config.evaluation.whole_episodes if subtask is None else config.evaluation.episodes
        seed = evaluation_seed(config.seed, "deterministic", subtask)
        torch.manual_seed(seed)
        env = environment(config, subtask, number, seed)
        row = evaluate(env.base_env.expert(), env)
        env.close()
        named = {"task": config.task.name, "subtask": WHOLE if subtask is None else str(subtask)}
        settings = {"preassembled": config.env.preassembled, "velocity_scale": config.env.velocity_scale}
        kept = {name: row[name] for name in KEPT}
        rows.append({**named, "seed": config.seed, **settings, "episodes": number, **kept})
    return rows


if __name__ == "__main__":
    main()
