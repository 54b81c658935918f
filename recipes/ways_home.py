"""Each way home of a chain with recovery: how far parts had moved since the skill took over, and what came of it.

    python recipes/ways_home.py task=table_lack system=recover seed=0

`part` is what the skill moves, `target` what it is joined to. Fresh deterministic episodes; rows of one system and seed
replace those of the same in <results_dir>/<task>/ways_home.csv (columns: tstar_rl/seams/ways_home.py).
"""

from pathlib import Path

import pandas as pd
import torch
from omegaconf import DictConfig
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.chaining.chain import chain_folders, load_chain
from tstar_rl.chaining.recovery import RecoveringChain
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.recovery import chain_policy
from tstar_rl.env.task_tables import subtask_geometry
from tstar_rl.launch.steps import check_chain
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seams.ways_home import WaysHome
from tstar_rl.seeds import evaluation_seed


@recipe("ways_home", checkpoint=str)
def main(config: DictConfig) -> None:
    """Runs the chain and writes its table; prints the shares that succeeded."""
    check_chain(config, config.system)
    task, place = config.task.name, run_path(config.runs_dir, config.task.name, config.system, config.seed)
    skills = load_chain(place / config.checkpoint, task=task)
    policy = chain_policy(config, skills, chain_folders(place / config.checkpoint)).to(config.device)
    if not isinstance(policy, RecoveringChain):
        raise InvalidValueError(f"{place} is a chain without recovery: its arm never goes home")
    subtasks = [subtask_geometry(task, index) for index in range(len(skills))]
    parts = {
        "part": [one["moving_part"] for one in subtasks],
        "target": [one["target_part"] for one in subtasks],
    }
    watch = WaysHome(policy, parts)
    episodes, seed = config.evaluation.whole_episodes, evaluation_seed(config.seed, "ways_home")
    torch.manual_seed(seed)
    env = environment(config, None, episodes, seed)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        run_episodes(env, policy, watch, enough=len(skills))
    env.close()
    rows = [{"system": config.system, "seed": config.seed, **way} for way in watch.found]
    if not rows:
        print(f"the arm never went home in {episodes} episodes")
        return
    path = Path(config.results_dir) / task / "ways_home.csv"
    append_rows(path, rows, ("system", "seed"))
    mine = pd.DataFrame(rows)
    attempts = mine.succeeded.groupby([mine.skill, mine.way.clip(upper=1).map({0: "first", 1: "later"})])
    print(attempts.agg(["size", "mean"]).round(2).to_string())
    print(path)


if __name__ == "__main__":
    main()
