"""Which published experiments the page shows, from results/published/contents.yaml."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import TypeVar

import yaml

from tstar_rl.analysis.learned import Learned
from tstar_rl.analysis.page.headline import Headline, parse_headline
from tstar_rl.analysis.page.markdown import Paper
from tstar_rl.analysis.questions import Question
from tstar_rl.analysis.task_questions import TaskQuestion
from tstar_rl.checks import InvalidValueError
from tstar_rl.runs.run_folder import UNTRAINED

__all__ = ["Contents", "Entry", "read_contents"]

FILE = "contents.yaml"
KINDS = ("experiment", "single_policies", "paper", "ablations")
COMMITS = ("one", "several")
_Asked = TypeVar("_Asked", Question, TaskQuestion)


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
    no_gap: tuple[str, ...] = ()
    """Arms without a hand-over gap, since their skills start from other states alone than in the chain."""
    learned: Learned | None = None
    """Declared before the experiment ran: when a skill counts as learned."""
    late_trials: int | None = None
    """Declared before the experiment ran: the trial, counted from 1, that a chain's last one is compared with."""
    figure_arms: tuple[str, ...] = ()
    """Arms whose profiles and costs are drawn, where all would not be told apart; none named: all."""
    sections: tuple[str, ...] | None = None
    """Tasks with a section of their own on the page; None: all of them."""
    arms: Mapping[str, str] = field(default_factory=dict)
    """What some of its arms are called, where that differs from other experiments."""

    def named(self, paper: Paper) -> Paper:
        """docs/paper_results.yaml with what this experiment calls its arms."""
        return {**paper, "arms": {**paper.get("arms", {}), **self.arms}}

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
        InvalidValueError: for an unknown field or value, for a folder of results that the file does not name or names
            both as shown and as kept back, and what `parse_headline` raises.
    """
    root = Path(root)
    file = root / FILE
    if not file.is_file():
        raise FileNotFoundError(f"{file} says which published results the page shows, and is not there")
    values = yaml.safe_load(file.read_text())
    entries = tuple(_entry(root, one) for one in values["experiments"])
    named = {entry.folder.name for entry in entries}
    kept_back = set(values.get("kept_back") or ())
    if shown := named & kept_back:
        raise InvalidValueError(f"{file} shows and keeps back {', '.join(sorted(shown))}")
    left_out = {folder.name for folder in root.iterdir() if folder.is_dir()} - named - kept_back
    if left_out:
        raise InvalidValueError(f"{file} leaves out {', '.join(sorted(left_out))}")
    headline = parse_headline(root, values["headline"]) if "headline" in values else None
    return Contents(entries, headline)


def _entry(root: Path, one: dict) -> Entry:
    """One item of `experiments`."""
    known = [field.name for field in fields(Entry)]
    unknown = [str(name) for name in one if name not in known]
    if unknown:
        raise InvalidValueError(
            f"{root / FILE}: an experiment has no {', '.join(unknown)}; it has {', '.join(known)}"
        )
    pairs = _pairs(one.get("pairs", ()))
    families = tuple(_pairs(family) for family in one.get("families", ()))
    questions = tuple(_question(root, asked, Question) for asked in one.get("questions", ()))
    learned = _learned(root, one["learned"]) if "learned" in one else None
    over_tasks = tuple(_question(root, asked, TaskQuestion) for asked in one.get("task_questions", ()))
    for name, each in (("families", families), ("questions", [asked.pairs for asked in questions])):
        unknown = sorted({pair for named in each for pair in named} - set(pairs))
        if unknown:
            raise InvalidValueError(
                f"{root / FILE}: {name} of {one['folder']} have {unknown}, not in its pairs"
            )
    _check_families(root, one["folder"], families, questions)
    values = {
        **one,
        "folder": root / one["folder"],
        "pairs": pairs,
        "families": families,
        "questions": questions,
        "learned": learned,
        "task_questions": over_tasks,
        "choices": dict(zip(one.get("choices", {}), _pairs(one.get("choices", {}).values()), strict=True)),
        **{name: tuple(one.get(name, ())) for name in ("no_gap", "figure_arms")},
        "sections": None if one.get("sections") is None else tuple(one["sections"]),
    }
    entry = Entry(**values)
    for name, value, valid in (("kind", entry.kind, KINDS), ("commits", entry.commits, COMMITS)):
        if value not in valid:
            raise InvalidValueError(
                f"{root / FILE}: {name} of {one['folder']} must be one of {', '.join(valid)}, got {value}"
            )
    if not (entry.folder / "README.md").is_file():
        raise FileNotFoundError(f"{entry.folder / 'README.md'} gives an experiment's title, and is not there")
    return entry


def _check_families(
    root: Path, folder: str, families: Sequence[Sequence[tuple[str, str]]], questions: Sequence[Question]
) -> None:
    """A question with an improvement needs a corrected p-value, so each of its pairs must be in one family."""
    corrected = [pair for family in families for pair in family]
    twice = sorted({pair for pair in corrected if corrected.count(pair) > 1})
    if twice:
        raise InvalidValueError(
            f"{root / FILE}: families of {folder} share {twice}; a pair is corrected in one family"
        )
    asked = {pair for question in questions if question.improvement is not None for pair in question.pairs}
    if asked - set(corrected):
        raise InvalidValueError(
            f"{root / FILE}: questions of {folder} with an improvement ask for {sorted(asked - set(corrected))}, "
            "which no family of its families has"
        )


def _question(root: Path, asked: dict, kind: type[_Asked]) -> _Asked:
    """One item of an experiment's `questions` or `task_questions`."""
    _check_fields(root, "a question", asked, kind)
    if kind is Question:
        return kind(**{**asked, "pairs": _pairs(asked["pairs"]), "tasks": tuple(asked.get("tasks", ()))})
    return kind(**{**asked, "pair": _pairs([asked["pair"]])[0]})


def _learned(root: Path, given: dict) -> Learned:
    """An experiment's `learned`."""
    _check_fields(root, "learned", given, Learned)
    return Learned(**given)


def _check_fields(root: Path, what: str, given: dict, kind: type) -> None:
    valid = {field.name: field.default is MISSING for field in fields(kind)}
    wrong = [name for name in given if name not in valid]
    wrong += [name for name, it_is_needed in valid.items() if it_is_needed and name not in given]
    if wrong:
        needed = ", ".join(name for name, it_is_needed in valid.items() if it_is_needed)
        raise InvalidValueError(
            f"{root / FILE}: {what} has {', '.join(valid)}, and needs {needed}; of {given.get('asks', given)!r} "
            f"these are missing or unknown: {', '.join(wrong)}"
        )


def _pairs(listed: Iterable[Sequence[str]]) -> tuple[tuple[str, str], ...]:
    return tuple((str(first), str(second)) for first, second in listed)
