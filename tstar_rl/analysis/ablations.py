"""Ablations: variants of fine-tuning the same skills, from `configs/ablation/<name>.yaml`, and what their tables show.

A variant is an arm: its table and its comparisons are those of `experiments`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from tstar_rl.analysis.experiments import arm_table, compare_arms

__all__ = [
    "FOLDER",
    "SKILLS",
    "Ablation",
    "Variant",
    "ablation_finding",
    "ablation_table",
    "load_ablation",
    "load_ablation_metrics",
    "names",
    "read",
]

CONFIGS = Path(__file__).resolve().parents[2] / "configs" / "ablation"
FOLDER = "ablations"
SKILLS = f"{FOLDER}/skills"
"""The system under which the skills lie that every variant starts from."""


@dataclass(frozen=True)
class Variant:
    """One way of fine-tuning the same skills."""

    ablation: str
    name: str
    system: str
    """The recipe; no_finetuning has nothing to train."""
    overrides: tuple[str, ...] = ()
    """Hydra overrides, of training and of evaluation."""
    bonus_of: str | None = None
    """Pays as `bonus` what d_omega paid for a success on average in this other variant."""
    against: str | None = None
    """The variant that its result is compared with; None: the ablation's reference."""

    @property
    def place(self) -> str:
        """The system under which it lies: results/<task>/<place>/seed<k>."""
        return f"{FOLDER}/{self.ablation}/{self.name}"

    @property
    def trains(self) -> bool:
        return self.system != "no_finetuning"

    def first(self) -> "Variant":
        """The first variant of any ablation that runs the same: that one is run, and the others get its tables."""
        same = [each for name in names() for each in read(name).variants if each._run() == self._run()]
        return same[0]

    def source(self) -> "Variant | None":
        """The variant that `bonus_of` means."""
        return None if self.bonus_of is None else read(self.ablation).variant(self.bonus_of)

    def _run(self) -> tuple:
        source = self.source()
        return self.system, tuple(sorted(self.overrides)), source and source._run()


@dataclass(frozen=True)
class Ablation:
    """Variants beside each other, of which one is the reference that the others are compared with."""

    name: str
    reference: str
    variants: tuple[Variant, ...]

    def variant(self, name: str) -> Variant:
        """The variant of that name.

        Raises:
            ValueError: if there is none.
        """
        for variant in self.variants:
            if variant.name == name:
                return variant
        known = ", ".join(variant.name for variant in self.variants)
        raise ValueError(f"ablation {self.name} has no variant {name!r}; it has {known}")


def names() -> list[str]:
    """Every ablation there is."""
    return sorted(path.stem for path in CONFIGS.glob("*.yaml"))


def read(name: str) -> Ablation:
    """The ablation in `configs/ablation/<name>.yaml`.

    Raises:
        ValueError: if there is none, or its file names a field or a variant that there is not.
    """
    path = CONFIGS / f"{name}.yaml"
    if not path.is_file():
        raise ValueError(f"there is no ablation {name!r} in {CONFIGS}; there are {', '.join(names())}")
    return parse(name, yaml.safe_load(path.read_text()))


def parse(name: str, values: dict[str, Any]) -> Ablation:
    """An ablation from plain values; see `read`."""
    fields = ("name", "system", "overrides", "bonus_of", "against")
    for one in values["variants"]:
        unknown = [str(field) for field in one if field not in fields]
        if unknown:
            raise ValueError(
                f"ablation {name}: a variant has no {', '.join(unknown)}; it has {', '.join(fields)}"
            )
    variants = tuple(
        Variant(name, **{**one, "overrides": tuple(one.get("overrides", ()))}) for one in values["variants"]
    )
    found = [variant.name for variant in variants]
    if len(set(found)) < len(found):
        raise ValueError(f"ablation {name}: two variants have the same name; it has {', '.join(found)}")
    for variant in variants:
        if not variant.trains and not variant.name.startswith(variant.system):
            raise ValueError(
                f"ablation {name}: {variant.name} trains nothing, so call it {variant.system}..."
            )
    ablation = Ablation(name, values["reference"], variants)
    named = [other for variant in variants for other in (variant.bonus_of, variant.against) if other]
    for other in (ablation.reference, *named):
        ablation.variant(other)
    return ablation


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
    order, frames = [variant.name for variant in read(name).variants], []
    for path in sorted(Path(root).glob(f"*/{FOLDER}/{name}/*/seed*/{file}")):
        task, _, _, variant, seed = path.relative_to(root).parent.parts
        if variant in order:
            place = {"task": task, "variant": variant, "seed": int(seed.removeprefix("seed"))}
            frames.append(pd.read_csv(path).assign(**place))
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
    found = read(name)
    pairs = [(variant.name, variant.against or found.reference) for variant in found.variants]
    for task, part in rows.groupby("task"):
        count = part["seed"].nunique()
        lines.append(f"{task}, {count} seed{'s' * (count > 1)}, differences in progress:")
        for row in compare_arms(as_arms(part), [pair for pair in pairs if pair[0] != pair[1]]).itertuples():
            span = f"{row.difference:+.3f} [{row.low:+.3f}, {row.high:+.3f}]"
            lines.append(f"  {row.first} against {row.second}: {span}, {row.verdict}")
        if count == 1:
            lines.append("  One seed: how much training differs from run to run is not in these intervals.")
    return "\n".join(lines) or f"No finding yet. This makes the tables: {command(name)}"
