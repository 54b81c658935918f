"""Mistakes in contents.yaml, which says what the page shows."""

from pathlib import Path

import pytest
import yaml
from published_runs import contents

from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS

PUBLISHED = Path(__file__).resolve().parents[2] / "results" / "published"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"kind": "arms"},
            "odd.kind must be experiment or single_policies or paper or ablations, got 'arms'",
        ),
        ({"commits": "any"}, "odd.commits must be one or several, got 'any'"),
        ({"pair": []}, "odd has no pair; it has folder, kind, commits, pairs"),
        ({"kind": None}, "odd.kind must be .*, got None"),
        (
            {"pairs": ["tstar", "base"]},
            r"odd.pairs must be .*, each a list of 2, each text, got \['tstar', .*",
        ),
        ({"pairs": [["a", "b", "c"]]}, r"odd.pairs must be .* got \[\['a', 'b', 'c'\]\]"),
        ({"pairs": ["bc"]}, "odd.pairs must be a list, each a list of 2"),
        ({"choices": ["a"]}, "odd.choices must be a section, each value a list of 2, each text"),
        (
            {"questions": [{"asks": "Is it?", "pair": []}]},
            "odd: the question 'Is it\\?' has no pair; it has asks, pairs, seeds",
        ),
        (
            {"questions": [{"asks": "Is it?", "pairs": [], "seeds": "ten"}]},
            "question 'Is it\\?'.seeds must be a whole number, got 'ten'",
        ),
        (
            {"questions": [{"asks": "Is it?", "pairs": []}]},
            "question 'Is it\\?' lacks seeds, which must be a whole",
        ),
        (
            {"learned": {"least": 1}},
            "odd: learned has no least; it has",
        ),
        ({"goals": {"progress": 1.0}}, "odd: goals lacks success, which must be"),
        (
            {"questions": [{"asks": "Is it?", "pairs": [["a", "b"]], "seeds": 2}]},
            r"odd: questions have \[\('a', 'b'\)\], not in its pairs",
        ),
    ],
)
def test_mistakes_in_the_contents_are_named(published, change, message):
    contents(
        published, [{"folder": "odd", "kind": "experiment", **change}, {"folder": "plain", "kind": "paper"}]
    )
    with pytest.raises(ValueError, match=message):
        read_contents(published)


@pytest.mark.parametrize("text", ["", "experiments: odd\n", "- odd\n", "experiments: [odd]\n"])
def test_a_file_of_another_form_is_named(published, text):
    (published / "contents.yaml").write_text(text)
    with pytest.raises(InvalidValueError, match="contents.yaml"):
        read_contents(published)


def test_no_published_experiment_is_forgotten(published):
    contents(published, [{"folder": "odd", "kind": "experiment"}])
    with pytest.raises(ValueError, match="leaves out plain"):
        read_contents(published)
    (published / "odd" / "README.md").unlink()
    with pytest.raises(FileNotFoundError, match="README.md gives an experiment's title"):
        read_contents(published)


def test_an_experiment_that_is_kept_back_is_not_on_the_page(published):
    """Seeds of it can be kept before all are done, and nobody looks at them."""
    contents(published, [{"folder": "odd", "kind": "experiment"}], kept_back=["plain"])
    assert [entry.folder.name for entry in read_contents(published).experiments] == ["odd"]
    contents(published, [{"folder": "odd", "kind": "experiment"}], kept_back=["plain", "odd"])
    with pytest.raises(ValueError, match="shows and keeps back odd"):
        read_contents(published)
    contents(published, [{"folder": "odd", "kind": "experiment"}], kept_back="plain")
    with pytest.raises(ValueError, match="kept_back must be a list of folders, got 'plain'"):
        read_contents(published)
    entries = [{"folder": name, "kind": "experiment"} for name in ("odd", "plain")]
    contents(published, entries, kept_back=None)  # as the file is once the last name is deleted
    assert len(read_contents(published).experiments) == 2


def test_every_arm_and_task_that_the_contents_name_is_published_or_declared():
    files = (CONFIGS / "experiment").glob("*.yaml")
    declared = {
        file.stem: [arm["name"] for arm in yaml.safe_load(file.read_text())["arms"]] for file in files
    }
    named = 0
    for entry in read_contents(PUBLISHED).experiments:
        runs = list(entry.folder.glob("*/*/seed*"))
        arms = {run.parts[-2] for run in runs} | set(declared.get(entry.folder.name, ()))
        tasks = {run.parts[-3] for run in runs}
        pairs = [*entry.pairs, *entry.choices.values(), *(asked.pair for asked in entry.task_questions)]
        asked = {*(arm for pair in pairs for arm in pair), *entry.no_gap, *entry.figure_arms, *entry.arms}
        asked |= set(entry.goals.over) if entry.goals else set()
        assert asked <= arms, (entry.folder.name, sorted(asked - arms))
        of_questions = {task for question in entry.questions for task in question.tasks}
        assert {*(entry.sections or ()), *of_questions} <= tasks, entry.folder.name
        named += len(asked)
    assert named > 50
