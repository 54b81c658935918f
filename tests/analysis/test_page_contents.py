"""Mistakes in contents.yaml, which says what the page shows."""

import pytest
from published_runs import contents

from tstar_rl.analysis.page.contents import read_contents


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"kind": "arms"},
            "kind of odd must be one of experiment, single_policies, paper, ablations, got arms",
        ),
        ({"commits": "any"}, "commits of odd must be one of one, several, got any"),
        ({"pair": []}, "an experiment has no pair; it has folder, kind, commits, pairs"),
        (
            {"questions": [{"asks": "Is it?", "pair": []}]},
            "of 'Is it\\?' these are missing or unknown: pair, pairs, seeds",
        ),
        (
            {"questions": [{"asks": "Is it?", "pairs": [["a", "b"]], "seeds": 2}]},
            r"questions of odd have \[\('a', 'b'\)\], not in its pairs",
        ),
    ],
)
def test_mistakes_in_the_contents_are_named(published, change, message):
    contents(
        published, [{"folder": "odd", "kind": "experiment", **change}, {"folder": "plain", "kind": "paper"}]
    )
    with pytest.raises(ValueError, match=message):
        read_contents(published)


def test_no_published_experiment_is_forgotten(published):
    contents(published, [{"folder": "odd", "kind": "experiment"}])
    with pytest.raises(ValueError, match="leaves out plain"):
        read_contents(published)
    (published / "odd" / "README.md").unlink()
    with pytest.raises(FileNotFoundError, match="README.md gives an experiment's title"):
        read_contents(published)
