"""Each way home of a chain with recovery: how far parts had moved since the skill took over, and what came of it.

    python recipes/ways_home.py task=table_lack system=recover seed=0

`part` is what the skill moves, `target` what it is joined to. Fresh deterministic episodes of the last
checkpoint; the table is ways_home.csv, beside the run's evaluation (columns: tstar_rl/seams/ways_home.py).
"""

import torch
from omegaconf import DictConfig
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.chaining.chain import chain_folders, load_chain
from tstar_rl.chaining.recovery import RecoveringChain
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.chain import check_links
from tstar_rl.config.load import recipe
from tstar_rl.config.recovery import chain_policy
from tstar_rl.config.worlds import check_world
from tstar_rl.env.task_tables import joined_parts
from tstar_rl.launch.evaluations import check_chain
from tstar_rl.launch.run_folders import run_folder
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.runs.csv_tables import write_table
from tstar_rl.seams.ways_home import WaysHome
from tstar_rl.seeds import evaluation_seed


@recipe("ways_home")
def main(config: DictConfig) -> None:
    """Runs the chain and writes its table; prints the shares that succeeded."""
    check_chain(config, config.system)
    task, place = config.task.name, run_folder(config, "runs_dir") / "last"
    skills = load_chain(place, task=task)
    check_world(config, place / "skill0")
    check_links(config, len(skills))
    policy = chain_policy(config, skills, chain_folders(place)).to(config.device)
    if not isinstance(policy, RecoveringChain):
        raise InvalidValueError(f"{place} is a chain without recovery: its arm never goes home")
    watch = WaysHome(policy, joined_parts(task, len(skills)))
    episodes, seed = config.evaluation.whole_episodes, evaluation_seed(config.seed, "ways_home")
    torch.manual_seed(seed)
    env = environment(config, None, episodes, seed)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        run_episodes(env, policy, watch, enough=len(skills))
    env.close()
    table = watch.table()
    path = run_folder(config, "results_dir") / "ways_home.csv"
    write_table(path, table)
    which = table.way.clip(upper=1).map({0: "first", 1: "later"})
    print(table.succeeded.groupby([table.skill, which]).agg(["size", "mean"]).round(2).to_string())
    print(path)


if __name__ == "__main__":
    main()
