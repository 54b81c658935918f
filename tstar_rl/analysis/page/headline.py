"""The page's first figure: which arms and differences it shows, from contents.yaml."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from tstar_rl.analysis.experiments import compare_arms, read_experiment
from tstar_rl.analysis.figures import DrawnDifference, headline_figure
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import check

__all__ = ["Headline", "parse_headline"]


AS_WRITTEN: dict[str, Any] = {
    "folder": str,
    "arms": dict[str, str],
    "differences": dict[str, tuple[str, str]],
    "beside": dict[str, str],
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
    beside: Mapping[str, Path] = field(default_factory=dict)
    """Differences that are of another experiment, and its folder: seeds are paired by number, so both arms of a
    difference are of one experiment."""

    def figure(self) -> Figure:
        """Of the last checkpoints; see `headline_figure`.

        Raises:
            InvalidValueError: for what is beside and no difference, and for a difference of which its experiment has no
                seed.
        """
        if unknown := sorted(set(self.beside) - set(self.differences)):
            raise InvalidValueError(
                f"headline: beside names {unknown[0]!r}, which is none of its differences: "
                f"{', '.join(map(repr, self.differences))}"
            )
        rows = read_experiment(self.folder).chosen(self.task)
        found = [self._difference(words, rows) for words in self.differences]
        return headline_figure(rows, self.arms, found, self.margin)

    def _difference(self, words: str, rows: pd.DataFrame) -> DrawnDifference:
        """A row of the right half; `rows` are those of the figure's own experiment."""
        folder, pair = self.beside.get(words, self.folder), self.differences[words]
        of = rows if folder == self.folder else read_experiment(folder).chosen(self.task)
        found = compare_arms(of, [pair], absent_ok=True)
        if found.empty:
            raise InvalidValueError(
                f"headline: {words!r} needs a seed of {self.task} that {' and '.join(pair)} of {folder} both have"
            )
        by_seed = of.pivot_table(index="seed", columns="arm", values="progress", observed=True)
        return DrawnDifference(words, (by_seed[pair[0]] - by_seed[pair[1]]).dropna(), found.iloc[0])


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
    beside = {words: root / folder for words, folder in values.get("beside", {}).items()}
    return Headline(
        **{**values, "folder": root / values["folder"], "differences": differences, "beside": beside}
    )
