"""Whether a chain's skills are handed parts that were moved before their turn, and whether they then succeed.

    python recipes/moved_parts.py task=toy_table seed=0

`part` is what the skill moves, `target` what it is joined to. Fresh deterministic episodes of one checkpoint; nothing
is trained. The table is moved_parts.csv, beside the run's evaluation (columns: tstar_rl/seams/moved_parts.py, and
checkpoint, whose earlier rows are replaced). What is printed counts a part as moved if it lies from_metres, or is
turned from_degrees, from where the episode put it.
"""

from omegaconf import DictConfig
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.seams import chain_of
from tstar_rl.env.task_tables import joined_parts
from tstar_rl.launch.evaluations import check_chain
from tstar_rl.launch.run_folders import run_folder
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.runs.csv_tables import append_rows, check_table
from tstar_rl.seams.moved_parts import MovedParts, success_by_moved
from tstar_rl.seeds import evaluation_seed


@recipe("moved_parts", checkpoint=str, from_metres=float, from_degrees=float)
def main(config: DictConfig) -> None:
    """Runs the chain and writes its table; prints how often each skill succeeds, with its part moved and not."""
    check_chain(config, config.system)
    check_table(path := run_folder(config, "results_dir") / "moved_parts.csv")
    skills, number = chain_of(config, config.system), config.evaluation.whole_episodes
    watch = MovedParts(joined_parts(config.task.name, len(skills)))
    env = environment(config, None, number, evaluation_seed(config.seed, "moved_parts"))
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        run_episodes(env, ChainPolicy(skills).to(config.device), watch, enough=len(skills))
    env.close()
    table = watch.table().assign(checkpoint=config.checkpoint)
    if table.empty:
        raise InvalidValueError(
            "no skill was handed anything: the first one never succeeded, so there is no table"
        )
    append_rows(path, table.to_dict("records"), ("checkpoint",))
    print(success_by_moved(table, config.from_metres, config.from_degrees).round(3).to_string())
    print(path)


if __name__ == "__main__":
    main()
