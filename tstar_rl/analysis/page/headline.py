"""The page's first figure: which arms and differences it shows, from contents.yaml."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from tstar_rl.analysis.experiments import read_experiment
from tstar_rl.analysis.figures import headline_figure
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import check

__all__ = ["Headline", "parse_headline"]


AS_WRITTEN: dict[str, Any] = {
    "folder": str,
    "arms": dict[str, str],
    "differences": dict[str, tuple[str, str]],
    "beside": dict[str, tuple[str, ...]],
}
"""The types of fields in the file, where `Headline` has other ones."""


@dataclass(frozen=True)
class Headline:
    """A few arms of an experiment on one task, and the differences that answer its questions."""

    folder: Path
    task: str
    margin: float
    """A difference smaller than this does not matter."""
    arms: Mapping[str, str]
    """Names of arms, and what each is called here."""
    differences: Mapping[str, tuple[str, str]]
    """What each is called; the first arm minus the second."""
    beside: Mapping[Path, tuple[str, ...]] = field(default_factory=dict)
    """Arms of other experiments that differences are of. Seeds are paired by number, so each difference has both arms
    from one experiment."""

    def figure(self) -> Figure:
        """Of the last checkpoints; see `headline_figure`.

        Raises:
            InvalidValueError: for an arm that two experiments have, or that the one that is said to have it lacks; for
                a difference of arms of two experiments.
        """
        whose = {arm: folder for folder, arms in self.beside.items() for arm in arms}
        for words, (one, other) in self.differences.items():
            if whose.get(one) != whose.get(other):
                raise InvalidValueError(
                    f"headline: {words!r} is of {one} and {other}, arms of two experiments"
                )
        rows = read_experiment(self.folder).chosen(self.task)
        for folder, arms in self.beside.items():
            others = read_experiment(folder).chosen(self.task)
            if wrong := [arm for arm in arms if arm in set(rows["arm"]) or arm not in set(others["arm"])]:
                raise InvalidValueError(
                    f"headline: {', '.join(wrong)} of {folder} must be an arm of it and of no other"
                )
            rows = pd.concat([rows, others[others["arm"].isin(arms)]], ignore_index=True)
        return headline_figure(rows, self.arms, self.differences, self.margin)


def parse_headline(root: Path, values: Mapping[str, Any]) -> Headline:
    """From the item `headline` of contents.yaml.

    Args:
        root: of the published results.
        values: plain values.

    Raises:
        InvalidValueError: for a field that is missing or not known or of another type, and for a difference that is not
            of two arms.
    """
    check(values, Headline, "headline", AS_WRITTEN)
    differences = {words: (str(one), str(other)) for words, (one, other) in values["differences"].items()}
    beside = {root / folder: tuple(map(str, arms)) for folder, arms in values.get("beside", {}).items()}
    return Headline(
        **{**values, "folder": root / values["folder"], "differences": differences, "beside": beside}
    )
