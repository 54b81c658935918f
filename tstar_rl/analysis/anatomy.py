"""The anatomy of a chain's seams: what decides there, how far the skill that hands over moves it, and at what cost."""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from tstar_rl.analysis.differences import student_half
from tstar_rl.checks import InvalidValueError

__all__ = ["MEASURED", "anatomy_changes", "deciding_inputs", "seam_anatomy"]

FALL, OFF, OWN = "fall ", "off ", "own "
"""What columns of seams.csv begin with, before the name of a group of inputs; see `recipes/hand_over_gap.py`."""
CHAIN = ["system", "seed"]
MEASURED = ("off", "next_success", "own_success", "kept")
"""Columns of `seam_anatomy` that say how a chain does at a seam."""


def deciding_inputs(seams: pd.DataFrame, system: str) -> pd.DataFrame:
    """By how much a classifier of the next skill's outcomes falls when a group of inputs is shuffled.

    Args:
        seams: rows of seams.csv, of one task and one checkpoint.
        system: whose seams.

    Returns:
        Index subtask (of the skill that takes over) and seed, a column for each group; only seams at which there were
        enough successes and failures to fit one.
    """
    rows = seams[seams["system"] == system].set_index(["subtask", "seed"]).sort_index()
    falls = rows[[name for name in rows if str(name).startswith(FALL)]]
    return falls.rename(columns=lambda name: str(name).removeprefix(FALL)).dropna()


def seam_anatomy(
    seams: pd.DataFrame, gaps: pd.DataFrame, metrics: pd.DataFrame, systems: Sequence[str]
) -> pd.DataFrame:
    """How each chain does at each seam.

    Args:
        seams: see `deciding_inputs`.
        gaps: rows of hand_over_gap.csv of the same chains; those of a floor are left out.
        metrics: of `read_metrics`, of the same task; of chains without a row nothing is said of turns.
        systems: the chains to compare. What decides a seam is what decides it for the first one, on the mean of its
            seeds.

    Returns:
        A row for each seam, system and seed: subtask (of the skill that takes over), system, seed, by (the group of
        inputs that decides), off (how far that is off what the next skill saw, in the unit of `off_starts`: m of a
        position, else degrees) and saw (how far its own starts are off their mean), next_success, own_success (of the
        skill that hands over, from its own starts) and kept (share of its turns that the gate kept).

    Raises:
        InvalidValueError: for a system that is not measured, or without a seam of which it is known what decides.
    """
    if wrong := [name for name in systems if name not in set(seams["system"])]:
        raise InvalidValueError(
            f"no seams of {', '.join(wrong)}: there are those of {', '.join(dict.fromkeys(seams['system']))}; "
            "recipes/hand_over_gap.py measures a chain"
        )
    falls = deciding_inputs(seams, systems[0])
    if falls.empty:
        raise InvalidValueError(
            f"at no seam of {systems[0]} there are enough successes and failures to say what decides"
        )
    decides = {int(subtask): str(rows.mean().idxmax()) for subtask, rows in falls.groupby("subtask")}
    alone = gaps[gaps["floor"] == 0].set_index(CHAIN)
    kept = _kept(metrics)
    rows = []
    for row in seams[seams["system"].isin(systems)].to_dict("records"):
        subtask, chain = row["subtask"], (row["system"], row["seed"])
        if (group := decides.get(subtask)) is None:
            continue
        own = alone.at[chain, f"own_{subtask - 1}"] if chain in alone.index else math.nan
        rows.append(
            {"subtask": subtask, "system": chain[0], "seed": chain[1], "by": group}
            | {"off": row[OFF + group], "saw": row[OWN + group], "next_success": row["succeeded"]}
            | {"own_success": own, "kept": kept.get((*chain, subtask - 1), math.nan)}
        )
    return pd.DataFrame(rows).sort_values(["subtask", *CHAIN], ignore_index=True)


def anatomy_changes(table: pd.DataFrame, first: str, second: str) -> pd.DataFrame:
    """The first chain less the second, on the seeds of both: mean over seeds, half of Student's 95% interval.

    Args:
        table: of `seam_anatomy`.
        first, second: systems.

    Returns:
        A row for each seam and each of `MEASURED` that both have: subtask, what, seeds, difference, t_half.
    """
    lines = []
    for subtask, rows in table.groupby("subtask"):
        one, other = (rows[rows["system"] == name].set_index("seed") for name in (first, second))
        for what in MEASURED:
            changes = (one[what] - other[what]).dropna().to_numpy()
            if len(changes):
                line = {"subtask": subtask, "what": what, "seeds": len(changes)}
                lines.append(line | {"difference": np.mean(changes), "t_half": student_half(changes)})
    return pd.DataFrame(lines)


def _kept(metrics: pd.DataFrame) -> dict[tuple[str, int, int], float]:
    """Of each chain and skill, the share of its turns that the gate kept."""
    if "accepted" not in metrics:
        return {}
    judged = metrics[(metrics["subtask"] == -1) & metrics["accepted"].notna()]
    shares = judged.groupby(["recipe", "seed", "skill"], as_index=False)["accepted"].mean()
    return {(str(row.recipe), int(row.seed), int(row.skill)): row.accepted for row in shares.itertuples()}
