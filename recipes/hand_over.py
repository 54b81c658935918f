"""What a chain's skills hand over: success from where the skill before ends, against success from a skill's own starts.

    python recipes/hand_over.py task=table_lack seed=0            # systems=[tstar]: one of the chains

Fresh deterministic episodes. The chain is followed skill by skill: the states in which one succeeds are the next one's
starts, each of them once ("handed" of them). Rows replace those of the same chain in
<results_dir>/<task>/hand_over.csv; the picture beside it shows the mean over all seeds.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from tensordict import TensorDictBase
from torchrl.envs import TransformedEnv

from tstar_rl.analysis import hand_over_matrix, save_figure
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.load import recipe
from tstar_rl.config.seams import chain_of, env_at_seam
from tstar_rl.intervals import share_columns
from tstar_rl.launch.evaluations import check_chain
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.csv_tables import append_rows, check_table
from tstar_rl.seams.exchange import run_from
from tstar_rl.seeds import evaluation_seed


@recipe("hand_over", checkpoint=str, systems=tuple[str, ...])
def main(config: DictConfig) -> None:
    """Tries every chain, writes and prints the table."""
    for system in config.systems:
        check_chain(config, system)
    path = Path(config.results_dir) / config.task.name / "hand_over.csv"
    check_table(path)
    chains = {system: chain_of(config, system) for system in config.systems}  # before any is measured
    rows = [row for system, skills in chains.items() for row in _follow(config, system, skills)]
    table = append_rows(path, rows, ("system", "seed", "checkpoint"))
    print(table.round(3).to_string(index=False))
    chosen = table[table.checkpoint == config.checkpoint]
    print(save_figure(hand_over_matrix(chosen), path.with_suffix(".png")))


def _follow(config: DictConfig, system: str, skills: Sequence[Skill]) -> list[dict[str, Any]]:
    """A row for each skill; what it was handed is empty where none before has succeeded."""
    rows, episodes = [], config.evaluation.episodes
    reached: TensorDictBase | None = None

    def make(subtask: int, number: int, starts: TerminationSet | None) -> TransformedEnv:
        seed = evaluation_seed(config.seed, "hand_over", subtask)
        return env_at_seam(config, seed, subtask, number, starts)

    for index, skill in enumerate(skills):
        row: dict[str, Any] = {"system": system, "seed": config.seed, "checkpoint": config.checkpoint}
        row |= {"subtask": index, "episodes": episodes}
        own = run_from(make, index, skill, None, episodes)
        row |= share_columns("own_starts", own.batch_size[0], episodes)
        handed = 0 if reached is None else reached.batch_size[0]
        reached = own if reached is None else run_from(make, index, skill, reached, 0)
        row |= {"handed": handed} | share_columns("handed_over", reached.batch_size[0], handed)
        rows.append(row)
    return rows


if __name__ == "__main__":
    main()
