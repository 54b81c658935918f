"""What a chain's skills hand over: success from where the skill before ends, against success from a skill's own starts.

    python recipes/hand_over.py task=table_lack seed=0            # systems=[tstar]: one of the chains

Fresh deterministic episodes. The chain is followed skill by skill: the states in which one succeeds are the next one's
starts. Rows of one seed replace those of the same seed in <results_dir>/<task>/hand_over.csv; the picture beside it
shows the mean over all seeds.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig
from tensordict import TensorDictBase
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.analysis import hand_over_matrix, save_figure
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.seams import chain_of
from tstar_rl.intervals import wilson_interval
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.seeds import derive_seed


@recipe("hand_over", checkpoint=str, systems=tuple[str, ...])
def main(config: DictConfig) -> None:
    """Tries every chain, writes and prints the table."""
    rows = [row for system in config.systems for row in _follow(config, system, chain_of(config, system))]
    path = Path(config.results_dir) / config.task.name / "hand_over.csv"
    table = append_rows(path, rows, ("system", "seed", "checkpoint", "subtask"))
    print(table.round(3).to_string(index=False))
    chosen = table[table.checkpoint == config.checkpoint]
    print(save_figure(hand_over_matrix(chosen), path.with_suffix(".png")))


def _follow(config: DictConfig, system: str, skills: Sequence[Skill]) -> list[dict[str, Any]]:
    """A row for each skill; what it was handed is empty where none before has succeeded."""
    rows = []
    before = TerminationSet(config.evaluation.episodes, config.device)
    for index, skill in enumerate(skills):
        row: dict[str, Any] = {"system": system, "seed": config.seed, "checkpoint": config.checkpoint}
        row |= {"subtask": index, "episodes": config.evaluation.episodes}
        own, last = _try(config, index, skill, None)
        row |= _share("own_starts", own, config.evaluation.episodes)
        row |= dict.fromkeys(("handed_over", "handed_over_low", "handed_over_high"), math.nan)
        reached = TerminationSet(config.evaluation.episodes, config.device)
        if index and len(before):
            handed, last = _try(config, index, skill, before)
            row |= _share("handed_over", handed, config.evaluation.episodes)
        if index == 0 or len(before):
            reached.extend_from(last)
        before = reached
        rows.append(row)
    return rows


def _try(
    config: DictConfig, index: int, skill: Skill, before: TerminationSet | None
) -> tuple[float, TensorDictBase]:
    """Success from the states of `before` alone, or from the skill's own starts; and the last steps."""
    seed = derive_seed(config.seed, "evaluate", 2, index)
    torch.manual_seed(seed)
    env = environment(
        config, index, config.evaluation.episodes, seed, before, snapshots=True, shares={"buffer": 1.0}
    )
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, skill.policy)
    env.close()
    return float(last["next", "success"].double().mean()), last


def _share(name: str, share: float, episodes: int) -> dict[str, float]:
    low, high = wilson_interval(round(share * episodes), episodes)
    return {name: share, f"{name}_low": low, f"{name}_high": high}


if __name__ == "__main__":
    main()
