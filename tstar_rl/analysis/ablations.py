"""What the tables of an ablation show. A variant is an arm: tables and comparisons are those of `experiments`."""

from pathlib import Path

import pandas as pd

from tstar_rl.analysis import variants
from tstar_rl.analysis.differences import outer_ends, signed_interval
from tstar_rl.analysis.experiments import arm_table, compare_arms
from tstar_rl.analysis.tables import check_seed
from tstar_rl.runs.csv_tables import read_table

__all__ = [
    "ablation_finding",
    "ablation_table",
    "as_arms",
    "command",
    "load_ablation",
    "load_ablation_metrics",
]


def command(name: str) -> str:
    """What makes the tables of an ablation."""
    return f"python recipes/ablate.py ablation={name} seed=0"


def load_ablation(
    name: str, root: str | Path = "results", checkpoint: str = "last", mode: str = "deterministic"
) -> pd.DataFrame:
    """The evaluations of an ablation, a row for each task, variant and seed; prints which variants have none.

    Args:
        name: of `configs/ablation/<name>.yaml`.
        root: folder of results.
        checkpoint: last or best.
        mode: of the policies.

    Raises:
        ValueError: for an unknown ablation, with the known ones.
    """
    rows = _load(name, root, "evaluation.csv")
    if len(rows):
        rows = rows[(rows.checkpoint == checkpoint) & (rows["mode"] == mode)].reset_index(drop=True)
    missing = [one for one in rows["variant"].cat.categories if one not in set(rows["variant"])]
    if missing:
        print(f"No table yet of {', '.join(missing)}. This makes it: {command(name)}")
    return rows.sort_values(["task", "variant", "seed"], ignore_index=True)


def load_ablation_metrics(name: str, root: str | Path = "results") -> pd.DataFrame:
    """What the variants of an ablation logged while they were trained."""
    return _load(name, root, "metrics.csv")


def _load(name: str, root: str | Path, file: str) -> pd.DataFrame:
    order, frames = [variant.name for variant in variants.read(name).variants], []
    for path in sorted(Path(root).glob(f"*/{variants.FOLDER}/{name}/*/seed*/{file}")):
        task, _, _, variant, seed = path.relative_to(root).parent.parts
        if variant in order:
            place = {"task": task, "variant": variant, "seed": int(seed.removeprefix("seed"))}
            check_seed(table := read_table(path), place["seed"], path)
            frames.append(table.assign(**place))
    columns = ["task", "variant", "seed"]
    table = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=columns)
    table["variant"] = pd.Categorical(table["variant"], order, ordered=True)
    table.attrs["ablation"] = name
    return table


def as_arms(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows with column arm in place of variant."""
    return rows.assign(arm=rows["variant"].astype(str))


def ablation_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A line for each task and variant: see `experiments.arm_table`; then the mean of each subtask's share."""
    shares = [name for name in rows if str(name).startswith("subtask_")]
    parts = {}
    for task, part in rows.groupby("task"):
        means = part.groupby("variant", observed=True)[shares].mean().rename_axis("arm")
        parts[task] = arm_table(as_arms(part)).join(means.set_axis(means.index.astype(str)))
    return pd.concat(parts, names=["task", "variant"]) if parts else pd.DataFrame()


def ablation_finding(rows: pd.DataFrame) -> str:
    """Sentences on what the table shows: each variant against the one it is compared with, on the same seeds."""
    name, lines = rows.attrs["ablation"], []
    found = variants.read(name)
    pairs = [(variant.name, variant.against or found.reference) for variant in found.variants]
    for task, part in rows.groupby("task"):
        count = part["seed"].nunique()
        lines.append(f"{task}, {count} seed{'s' * (count > 1)}, differences in progress:")
        compared = [pair for pair in pairs if pair[0] != pair[1]]
        for row in compare_arms(as_arms(part), compared, absent_ok=True).itertuples():
            ends = outer_ends(row.difference, row.low, row.high, row.t_half)
            span = signed_interval(row.difference, *ends)
            seeds = f" ({row.seeds} of them)" if int(row.seeds) < count else ""
            lines.append(f"  {row.first} against {row.second}: {span}, {row.verdict}{seeds}")
        if count == 1:
            lines.append("  One seed: how much training differs from run to run is not in these intervals.")
    return "\n".join(lines) or f"No finding yet. This makes the tables: {command(name)}"
