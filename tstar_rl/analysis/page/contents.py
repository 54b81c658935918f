"""Which published experiments the page shows, from results/published/contents.yaml."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar

import yaml

from tstar_rl.analysis.aids import Aids
from tstar_rl.analysis.goals import Goals
from tstar_rl.analysis.learned import Learned
from tstar_rl.analysis.page.headline import Headline, parse_headline
from tstar_rl.analysis.page.markdown import Paper
from tstar_rl.analysis.questions import Question
from tstar_rl.analysis.task_questions import TaskQuestion
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import check
from tstar_rl.runs.run_folder import UNTRAINED

__all__ = ["Contents", "Entry", "read_contents"]

FILE = "contents.yaml"

Rule = TypeVar("Rule", Learned, Aids)


@dataclass(frozen=True)
class Entry:
    """One experiment on the page."""

    folder: Path
    kind: str
    commits: str = "one"
    """one: arms of several commits are refused; several: the page says which."""
    pairs: tuple[tuple[str, str], ...] = ()
    """Arms that are compared: first minus second."""
    families: tuple[tuple[tuple[str, str], ...], ...] = ()
    """Pairs that decide a question together: the p-values of each family are corrected for how many they are."""
    questions: tuple[Question, ...] = ()
    """Declared before the experiment ran, with the rule that answers each."""
    reference: str = UNTRAINED
    """The arm over which, of several tasks, the improvement of the others is shown."""
    least_skill: float | None = None
    """Of several tasks only those are aggregated whose skills each succeed so often from their own starts."""
    task_questions: tuple[TaskQuestion, ...] = ()
    """Declared before the experiment ran, over several tasks."""
    choices: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """What is chosen, in words, and the pair of arms whose difference says what that adds."""
    goals: Goals | None = None
    """Declared before the experiment ran: the levels that an arm should reach."""
    no_gap: tuple[str, ...] = ()
    """Arms without a hand-over gap, since their skills start from other states alone than in the chain."""
    learned: Learned | None = None
    """Declared before the experiment ran: when a skill counts as learned."""
    aids: Aids | None = None
    """Declared before the experiment ran: the arm with all aids of training, and when one counts as needed."""
    late_trials: int | None = None
    """Declared before the experiment ran: the round, counted from 1, whose trial the last one is compared with."""
    exchanged: Path | None = None
    """A table of `recipes/exchanged.py` of the first of its pairs, all of its seeds, one task."""
    figure_arms: tuple[str, ...] = ()
    """Arms whose profiles and costs are drawn, where all would not be told apart; none named: all."""
    sections: tuple[str, ...] | None = None
    """Tasks with a section of their own on the page; None: all of them."""
    arms: Mapping[str, str] = field(default_factory=dict)
    """What some of its arms are called, where that differs from other experiments."""

    def named(self, paper: Paper) -> Paper:
        """docs/paper_results.yaml with what this experiment calls its arms."""
        systems = {
            name: {**values, "label": self.arms.get(name, values["label"])}
            for name, values in paper["systems"].items()
        }
        return {**paper, "systems": systems, "arms": {**paper.get("arms", {}), **self.arms}}

    def has_section(self, task: str) -> bool:
        """Whether the page has a section of this task."""
        return self.sections is None or task in self.sections

    @property
    def prefix(self) -> str:
        """Of its figures."""
        return f"{self.folder.name}_"

    def intro(self) -> str:
        """Its README.md: a title, and what was done; links are those of a page in docs/."""
        return (self.folder / "README.md").read_text().strip().replace("](../../../docs/", "](")

    @property
    def title(self) -> str:
        return self.intro().splitlines()[0].removeprefix("# ")


@dataclass(frozen=True)
class Contents:
    """All experiments, in the order of the page."""

    experiments: tuple[Entry, ...]
    headline: Headline | None = None
    """The page's first figure."""


def read_contents(root: str | Path) -> Contents:
    """Reads contents.yaml.

    Args:
        root: of the published results.

    Raises:
        FileNotFoundError: if there is no such file, or an experiment's folder has no README.md.
        InvalidValueError: for an unknown or missing field, for a value of another type, for a folder of results that
            the file does not name or names both as shown and as kept back, and what `parse_headline` raises.
    """
    root = Path(root)
    file = root / FILE
    if not file.is_file():
        raise FileNotFoundError(f"{file} says which published results the page shows, and is not there")
    values = yaml.safe_load(file.read_text())
    if not isinstance(values, Mapping) or not isinstance(values.get("experiments"), list):
        raise InvalidValueError(f"{file} must have a list of experiments, got {values!r:.80}")
    entries = tuple(_entry(root, one) for one in values["experiments"])
    named = {entry.folder.name for entry in entries}
    kept_back = _kept_back(values.get("kept_back"), file)
    if shown := named & kept_back:
        raise InvalidValueError(f"{file} shows and keeps back {', '.join(sorted(shown))}")
    left_out = {folder.name for folder in root.iterdir() if folder.is_dir()} - named - kept_back
    if left_out:
        raise InvalidValueError(f"{file} leaves out {', '.join(sorted(left_out))}")
    headline = parse_headline(root, values["headline"]) if "headline" in values else None
    return Contents(entries, headline)


def _kept_back(given: Any, file: Path) -> set[str]:
    listed = given or []
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise InvalidValueError(f"{file}: kept_back must be a list of folders, got {given!r}")
    return set(listed)


AS_WRITTEN: dict[str, Any] = {
    "folder": str,
    "exchanged": str,
    "kind": Literal["experiment", "single_policies", "paper", "ablations"],
    "commits": Literal["one", "several"],
    "questions": tuple[dict[str, Any], ...],
    "task_questions": tuple[dict[str, Any], ...],
    "choices": dict[str, tuple[str, str]],
    "learned": dict[str, Any],
    "aids": dict[str, Any],
    "goals": dict[str, Any],
    "arms": dict[str, str],
}
"""The types of an item's fields in the file, where `Entry` has other ones."""


def _entry(root: Path, one: Any) -> Entry:
    """One item of `experiments`."""
    if not isinstance(one, Mapping):
        raise InvalidValueError(f"{root / FILE}: an experiment has a folder and a kind, got {one!r}")
    where = f"{root / FILE}: {one.get('folder', 'an experiment')}"
    check(one, Entry, where, AS_WRITTEN)
    parse: dict[str, Callable[[Any], Any]] = {
        "folder": lambda name: root / name,
        "exchanged": lambda name: root / name,
        "pairs": _pairs,
        "families": lambda families: tuple(map(_pairs, families)),
        "questions": lambda asked: tuple(_question(each, where) for each in asked),
        "task_questions": lambda asked: tuple(_task_question(each, where) for each in asked),
        "choices": lambda choices: dict(zip(choices, _pairs(choices.values()), strict=True)),
        "learned": lambda given: _declared(Learned, given, f"{where}: learned"),
        "aids": lambda given: _declared(Aids, given, f"{where}: aids"),
        "goals": lambda given: _goals(given, where),
        **{name: lambda listed: listed and tuple(listed) for name in ("no_gap", "figure_arms", "sections")},
    }
    entry = Entry(**{name: parse[name](value) if name in parse else value for name, value in one.items()})
    _check_pairs(entry, where)
    _check_families(entry, where)
    if not (entry.folder / "README.md").is_file():
        raise FileNotFoundError(f"{entry.folder / 'README.md'} gives an experiment's title, and is not there")
    return entry


def _check_pairs(entry: Entry, where: str) -> None:
    """What a question or a family compares must be among the entry's pairs."""
    for name, each in (
        ("families", entry.families),
        ("questions", [asked.pairs for asked in entry.questions]),
    ):
        unknown = sorted({pair for named in each for pair in named} - set(entry.pairs))
        if unknown:
            raise InvalidValueError(f"{where}: {name} have {unknown}, not in its pairs")
    if entry.exchanged is not None and not entry.pairs:
        raise InvalidValueError(
            f"{where}: exchanged needs pairs, whose first says which arm's skills stand in whose place"
        )


def _check_families(entry: Entry, where: str) -> None:
    """A question with an improvement needs a corrected p-value, so each of its pairs must be in one family."""
    corrected = [pair for family in entry.families for pair in family]
    twice = sorted({pair for pair in corrected if corrected.count(pair) > 1})
    if twice:
        raise InvalidValueError(f"{where}: families share {twice}; a pair is corrected in one family")
    asked = {
        pair for question in entry.questions if question.improvement is not None for pair in question.pairs
    }
    if asked - set(corrected):
        raise InvalidValueError(
            f"{where}: questions with an improvement ask for {sorted(asked - set(corrected))}, which no family of its "
            "families has"
        )


def _question(asked: Mapping[str, Any], where: str) -> Question:
    """One item of an experiment's `questions`."""
    check(asked, Question, f"{where}: the question {asked.get('asks')!r}")
    return Question(**{**asked, "pairs": _pairs(asked["pairs"]), "tasks": tuple(asked.get("tasks", ()))})


def _task_question(asked: Mapping[str, Any], where: str) -> TaskQuestion:
    """One item of an experiment's `task_questions`."""
    check(asked, TaskQuestion, f"{where}: the question {asked.get('asks')!r}")
    return TaskQuestion(**{**asked, "pair": _pairs([asked["pair"]])[0]})


def _declared(kind: type[Rule], given: Mapping[str, Any], where: str) -> Rule:
    """A rule of an experiment, such as its `learned`."""
    check(given, kind, where)
    return kind(**given)


def _goals(given: Mapping[str, Any], where: str) -> Goals:
    """An experiment's `goals`."""
    check(given, Goals, f"{where}: goals")
    return Goals(**{**given, "over": tuple(given["over"])})


def _pairs(listed: Iterable[Sequence[str]]) -> tuple[tuple[str, str], ...]:
    return tuple((str(first), str(second)) for first, second in listed)
