"""How large a chain's hand-over gap is, whether a floor closes it, and what decides the next skill's outcome.

    python recipes/hand_over_gap.py task=table_lack scale=laptop seed=1
    python recipes/hand_over_gap.py task=table_lack scale=narrow seed=0 system=tstar checkpoint=best

Nothing is trained. <results_dir>/<task>/hand_over_gap.csv has a row for the chain as it was trained (floor 0) and one
for each floor under its normalisers' deviations; its gap is the product of the skills' own success, as trained, less
that row's progress. <results_dir>/<task>/seams.csv has a row for each skill that takes over: the area under the curve
of a cross-validated classifier, by how much it falls when a group of inputs is shuffled, how far the group is off the
skill's own starts (see `tstar_rl.seams.off_starts`), success on either side of one input (split_by="joint 6"; null: the
strongest one), and how much of the outcome the skill before it decides (see `tstar_rl.seams.influence`). Rows of the
same chain are replaced; seams.png shows the two sides.
"""

import difflib
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.analysis.figures import save_figure, sides_figure
from tstar_rl.analysis.hand_over_gap import chain_interval, gap_interval, product_interval
from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.seams import chain_of, env_at_seam
from tstar_rl.env.task_tables import part_names, subtask_geometry
from tstar_rl.launch.evaluations import check_chain
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.hand_overs import HandOver, HandOvers
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.csv_tables import append_rows, check_table
from tstar_rl.seams.exchange import run_from
from tstar_rl.seams.influence import Influence, influence_of
from tstar_rl.seams.off_starts import off_starts
from tstar_rl.seams.two_sides import two_sides
from tstar_rl.seams.what_decides import (
    input_groups,
    input_names,
    one_sided_states,
    strongest_input,
    what_decides,
)
from tstar_rl.seeds import evaluation_seed


@recipe(
    "hand_over_gap", checkpoint=str, floors=tuple[float, ...], influence_starts=int, influence_times=int,
    split_by=str | None,
)  # fmt: skip
def main(config: DictConfig) -> None:
    """Measures one chain, writes and prints both tables."""
    check_chain(config, config.system)
    place, skills = Path(config.results_dir) / config.task.name, chain_of(config, config.system)
    chain = {"system": config.system, "seed": config.seed, "checkpoint": config.checkpoint}
    parts = part_names(config.task.name)
    if config.split_by not in (None, *(names := input_names(parts))):
        near = ", ".join(difflib.get_close_matches(config.split_by, names, n=3)) or ", ".join(names)
        raise InvalidValueError(f"split_by must be null or an input such as {near}; got {config.split_by!r}")
    for name in ("hand_over_gap.csv", "seams.csv"):
        check_table(place / name)
    alone = [_run_alone(config, index, skill) for index, skill in enumerate(skills)]
    own, starts = zip(*alone, strict=True)
    found = _influences(config, skills) if config.influence_starts else [None] * (len(skills) - 1)
    progress, seams = _run_chain(config, skills)
    rows = [chain | {"floor": 0.0} | _row(config, own, progress)]
    lines = [
        chain | _seam_row(each, parts, some, config.split_by) | _off_row(config, each, starts[each.subtask])
        for each, some in zip(seams, found, strict=True)
    ]
    for floor in sorted(config.floors):
        raised = sum(skill.normalizer.raise_to(floor) for skill in skills)
        progress, _ = _run_chain(config, skills)
        rows.append(chain | {"floor": floor, "raised_inputs": raised} | _row(config, own, progress))
    key = ("system", "seed", "checkpoint")
    print(append_rows(place / "hand_over_gap.csv", rows, key).round(3).to_string(index=False))
    table = append_rows(place / "seams.csv", lines, key)
    print(table.round(3).to_string(index=False))
    shown = table[table["checkpoint"] == config.checkpoint]
    print(save_figure(sides_figure(shown), place / "seams.png"))


def _run_alone(config: DictConfig, index: int, skill: Skill) -> tuple[int, Tensor]:
    """Successes of a skill from its own starts, and these starts, (n, O)."""
    env = environment(
        config, index, config.evaluation.episodes, evaluation_seed(config.seed, "own_starts", index)
    )
    starts: list[Tensor] = []

    def watch(tensordict: TensorDictBase) -> None:
        if not starts:
            starts.append(tensordict["observation"].clone())

    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, skill.policy, watch)
    env.close()
    return int(last["next", "success"].sum()), starts[0]


def _run_chain(config: DictConfig, skills: Sequence[Skill]) -> tuple[np.ndarray, list[HandOver]]:
    """Progress of each episode of the whole chain, and its seams; always from the same starts."""
    number, links = config.evaluation.whole_episodes, len(skills)
    env = environment(config, None, number, evaluation_seed(config.seed, "chain"))
    watch = HandOvers(links)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, ChainPolicy(skills).to(config.device), watch, enough=links)
    env.close()
    done = last["next", "completed"].squeeze(-1).clamp(max=links).double() / links
    return done.cpu().numpy(), watch.seams()


def _row(config: DictConfig, own: Sequence[int], progress: np.ndarray) -> dict[str, Any]:
    """Own success, product, progress and gap, with intervals."""
    episodes, rng = config.evaluation.episodes, np.random.default_rng(0)
    row: dict[str, Any] = {"episodes": episodes, "whole_episodes": len(progress)}
    row |= {f"own_{index}": successes / episodes for index, successes in enumerate(own)}
    row |= product_interval(own, episodes, rng).columns("product")
    row |= chain_interval(progress, rng).columns("progress")
    return row | gap_interval(own, episodes, progress, rng).columns("gap")


def _seam_row(
    seam: HandOver, parts: Sequence[str], influence: Influence | None, split_by: str | None
) -> dict[str, Any]:
    """What a skill is handed, how well that tells its outcome, by what, and how much the skill before decides."""
    won = seam.succeeded
    decision = what_decides(seam.observations, won, input_groups(parts))
    row: dict[str, Any] = {"subtask": seam.subtask, "states": len(won)}
    row |= {"succeeded": float(won.double().mean()) if len(won) else math.nan, "area": decision.area}
    row |= {f"fall {name}": fall for name, fall in decision.falls.items()}
    names = input_names(parts)
    row["strongest"], row["strongest_area"] = strongest_input(seam.observations, won, names)
    row["split_by"] = by = split_by or row["strongest"]
    states = one_sided_states(seam.observations)  # the numbers whose area is strongest_area
    values = states[:, names.index(by)] if by else states[:0, 0]
    row |= two_sides(values, won.cpu())._asdict()
    known = influence or Influence(0, math.nan, math.nan)
    return row | {
        "influence_starts": known.starts,
        "succeeded_sampled": known.succeeded,
        "within": known.within,
    }


def _off_row(config: DictConfig, seam: HandOver, starts: Tensor) -> dict[str, float]:
    """How far each group of inputs is off the own starts of the skill that takes over; how far these vary."""
    name = config.task.name
    joined = [subtask_geometry(name, index) for index in range(seam.subtask)]
    bases = {one["moving_part"]: one["target_part"] for one in joined}
    found = off_starts(seam.observations, starts, part_names(name), bases)
    off = {f"off {group}": each.handed for group, each in found.items()}
    return off | {f"own {group}": each.own for group, each in found.items()}


def _influences(config: DictConfig, skills: Sequence[Skill]) -> list[Influence | None]:
    """Of each seam; None from the first on that nothing reaches."""
    make = partial(_env_from, config)
    env = _env_from(config, 0, config.influence_starts, None)
    starts: TensorDictBase = env.reset().select("observation", "snapshot")
    env.close()
    found: list[Influence | None] = []
    for index in range(len(skills) - 1):
        if not starts.batch_size[0]:
            found.append(None)
            continue
        torch.manual_seed(evaluation_seed(config.seed, "influence", index))
        both = skills[index].policy, skills[index + 1].policy
        found.append(influence_of(make, both, index, starts, config.influence_times))
        starts = run_from(make, index, skills[index], starts, 0)
    return found


def _env_from(config: DictConfig, index: int, number: int, starts: TerminationSet | None) -> Any:
    return env_at_seam(config, evaluation_seed(config.seed, "influence", index), index, number, starts)


if __name__ == "__main__":
    main()
