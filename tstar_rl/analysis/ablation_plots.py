"""Tables, pictures and findings of ablations, from the CSV files that `recipes/ablate.py` leaves.

An interval is the wider of two: over episodes (95%, all seeds pooled), and over seeds (95%, Student's t), which a
single seed cannot tell.
"""

import math
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from scipy.stats import t as student

from tstar_rl.analysis import ablation
from tstar_rl.intervals import wilson_interval

__all__ = [
    "ablation_bars",
    "ablation_curves",
    "ablation_finding",
    "ablation_table",
    "load_ablation",
    "load_ablation_metrics",
]

MEASURES = ("progress", "success")


def _load(name: str, root: str | Path, file: str) -> pd.DataFrame:
    order = [variant.name for variant in ablation.read(name).variants]
    frames = []
    for path in sorted(Path(root).glob(f"*/{ablation.FOLDER}/{name}/*/seed*/{file}")):
        task, _, _, variant, seed = path.relative_to(root).parent.parts
        if variant in order:
            place = {"task": task, "variant": variant, "seed": int(seed.removeprefix("seed"))}
            frames.append(pd.read_csv(path).assign(**place))
    table = (
        pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=["task", "variant", "seed"])
    )
    table["variant"] = pd.Categorical(table["variant"], order, ordered=True)
    table.attrs["ablation"] = name
    return table


def load_ablation(
    name: str, root: str | Path = "results", checkpoint: str = "last", mode: str = "deterministic"
) -> pd.DataFrame:
    """The evaluations of an ablation, a row for each task, variant and seed; says which variants have none.

    Args:
        name: of `configs/ablation/<name>.yaml`.
        root: folder of results.
        checkpoint: last or best.
        mode: of the policies.

    Raises:
        ValueError: for an unknown ablation, with those there are.
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


def command(name: str) -> str:
    """What makes the tables of an ablation."""
    return f"python recipes/ablate.py ablation={name} seed=0"


def _subtasks(row: Any) -> list[float]:
    """Shares of episodes that completed each subtask that was to do."""
    return [float(row[name]) for name in row.index if name.startswith("subtask_") and not pd.isna(row[name])]


def progress_deviation(shares: list[float]) -> float:
    """Deviation of one episode's progress, from the shares s_k of episodes that completed subtask k = 0..L-1.

    With c subtasks completed, E[c] is the sum of s_k and E[c^2] that of (2 k + 1) s_k; progress is c / L.
    """
    mean = sum(shares)
    square = sum((2 * k + 1) * share for k, share in enumerate(shares))
    return math.sqrt(max(square - mean**2, 0.0)) / len(shares)


def _over_seeds(values: pd.Series) -> float:
    """Half the interval of a mean over seeds; 0 for one seed, which cannot tell."""
    if len(values) < 2:
        return 0.0
    return float(student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values)))


def _episode_error(rows: pd.DataFrame) -> float:
    """Standard error of the mean progress of the seeds in `rows`, as far as it comes from episodes."""
    variances = [progress_deviation(_subtasks(row)) ** 2 / row["episodes"] for _, row in rows.iterrows()]
    return math.sqrt(sum(variances)) / max(len(variances), 1)


def _summary(rows: pd.DataFrame) -> dict[str, float]:
    """One line of `ablation_table`, from the seeds of a variant."""
    progress, success, episodes = rows["progress"].mean(), rows["success"].mean(), int(rows["episodes"].sum())
    half = max(1.96 * _episode_error(rows), _over_seeds(rows["progress"]))
    low, high = wilson_interval(round(success * episodes), episodes)
    seeds = _over_seeds(rows["success"])
    line = {"seeds": len(rows), "episodes": episodes, "progress": progress}
    line |= {"progress_low": max(progress - half, 0.0), "progress_high": min(progress + half, 1.0)}
    line |= {"success": success, "success_low": max(min(low, success - seeds), 0.0)}
    line |= {"success_high": min(max(high, success + seeds), 1.0)}
    return line | {str(name): rows[name].mean() for name in rows if str(name).startswith("subtask_")}


def ablation_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A line for each task and variant: mean over seeds of progress and success with intervals, and by subtask."""
    groups = rows.groupby(["task", "variant"], observed=True)
    lines = {place: _summary(group) for place, group in groups}
    table = pd.DataFrame.from_dict(lines, orient="index")
    table.index = pd.MultiIndex.from_tuples(list(lines), names=["task", "variant"]) if lines else table.index
    return table


def _empty(rows: pd.DataFrame) -> Figure:
    figure, panel = plt.subplots(figsize=(7, 1))
    panel.text(0.5, 0.5, f"no table yet: {command(rows.attrs['ablation'])}", ha="center", va="center")
    panel.set_axis_off()
    plt.close(figure)
    return figure


def ablation_bars(rows: pd.DataFrame) -> Figure:
    """Progress and success of every variant with intervals, a row of panels for each task; dots are seeds."""
    if not len(rows):
        return _empty(rows)
    table, tasks = ablation_table(rows), list(dict.fromkeys(rows["task"]))
    figure, panels = plt.subplots(len(tasks), 2, figsize=(11, 3.6 * len(tasks)), squeeze=False, sharey=True)
    for line, task in zip(panels, tasks, strict=True):
        part, seeds = table.loc[task], rows[rows.task == task]
        labels = [str(name).replace("_", " ") for name in part.index]
        for panel, measure in zip(line, MEASURES, strict=True):
            mean = part[measure]
            ends = [mean - part[f"{measure}_low"], part[f"{measure}_high"] - mean]
            panel.bar(
                labels, mean, yerr=[end.clip(lower=0) for end in ends], capsize=3, color="lightsteelblue"
            )
            places = [list(part.index).index(name) for name in seeds["variant"]]
            panel.plot(places, seeds[measure], "k.", markersize=5)
            panel.set(title=f"{task}: {measure}", ylim=(0, 1.05))
            plt.setp(panel.get_xticklabels(), rotation=30, ha="right")
            panel.grid(axis="y", alpha=0.3)
    figure.tight_layout()
    plt.close(figure)
    return figure


def ablation_curves(metrics: pd.DataFrame, column: str = "success_rate") -> Figure:
    """A logged column while each skill was fine-tuned, mean over seeds: panels by task and skill, a line a variant.

    Raises:
        ValueError: if no run has logged the column.
    """
    if not len(metrics):
        return _empty(metrics)
    if column not in metrics:
        raise ValueError(f"nothing logged {column!r}; there are {', '.join(metrics.columns)}")
    tasks, skills = sorted(metrics["task"].unique()), sorted(metrics["skill"].unique())
    size = (3.6 * len(skills), 3.2 * len(tasks))
    figure, panels = plt.subplots(len(tasks), len(skills), figsize=size, squeeze=False, sharey=True)
    for (task, skill), part in metrics.groupby(["task", "skill"]):
        panel = panels[tasks.index(task), skills.index(skill)]
        for name, rows in part.dropna(subset=[column]).groupby("variant", observed=True):
            mean = rows.groupby("env_steps")[column].mean()
            panel.plot(mean.index, mean, marker=".", linewidth=1, label=str(name).replace("_", " "))
        panel.set(title=f"{task}: skill {int(skill)}", xlabel="environment steps")
        panel.grid(alpha=0.3)
        panel.set_ylabel(column.replace("_", " "))
    panels[0, 0].legend(fontsize=7)
    figure.tight_layout()
    plt.close(figure)
    return figure


def _difference(rows: pd.DataFrame, reference: pd.DataFrame) -> tuple[float, float] | None:
    """Mean difference of progress on the seeds that both have, and half its interval; None without such seeds."""
    both = sorted(set(rows["seed"]) & set(reference["seed"]))
    if not both:
        return None
    pair = [one[one["seed"].isin(both)].sort_values("seed") for one in (rows, reference)]
    differences = pd.Series(pair[0]["progress"].to_numpy() - pair[1]["progress"].to_numpy())
    episodes = 1.96 * math.hypot(*(_episode_error(one) for one in pair))
    return float(differences.mean()), max(episodes, _over_seeds(differences))


def ablation_finding(rows: pd.DataFrame) -> str:
    """Sentences on what the table shows: each variant against the one it is compared with, on the same seeds."""
    name = rows.attrs["ablation"]
    compared, lines = ablation.read(name), []
    for task, part in rows.groupby("task"):
        found = {str(variant): one for variant, one in part.groupby("variant", observed=True)}
        count = part["seed"].nunique()
        lines.append(f"{task}, {count} seed{'s' * (count > 1)}, differences in progress:")
        for variant in compared.variants:
            other = variant.against or compared.reference
            if variant.name == other or variant.name not in found or other not in found:
                continue
            difference = _difference(found[variant.name], found[other])
            if difference is not None:
                lines.append(f"  {variant.name} against {other}: {_in_words(*difference)}")
        if count == 1:
            lines.append("  One seed: how much training differs from run to run is not in these intervals.")
    return "\n".join(lines) or f"No finding yet. This makes the tables: {command(name)}"


def _in_words(difference: float, half: float) -> str:
    told = "not told apart" if abs(difference) <= half else "higher" if difference > 0 else "lower"
    return f"{difference:+.3f} +- {half:.3f}, {told}"
