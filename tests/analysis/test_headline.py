"""The page's first figure: what it draws, and mistakes in its item of contents.yaml."""

import pytest
import yaml
from published_runs import contents, write

from tstar_rl.analysis.page import draw_page
from tstar_rl.analysis.page.contents import read_contents

SHOWN = {
    "folder": "odd",
    "task": "table",
    "margin": 0.1,
    "arms": {"tstar": "with it", "buffer": "without"},
    "differences": {"what it adds": ["tstar", "buffer"]},
}


@pytest.fixture
def published(tmp_path):
    """Two arms of two seeds, which differ by .25 and by .5."""
    for seed, ours, theirs in ((3, 0.75, 0.5), (4, 1.0, 0.5)):
        write(tmp_path, "odd", "tstar", seed, ours)
        write(tmp_path, "odd", "buffer", seed, theirs)
    (tmp_path / "odd" / "README.md").write_text("# Odd chains\n")

    def shown(**changed):
        folders = sorted(folder.name for folder in tmp_path.iterdir() if folder.is_dir())
        contents(tmp_path, [{"folder": folder, "kind": "experiment"} for folder in folders])
        file = tmp_path / "contents.yaml"
        file.write_text(
            file.read_text() + yaml.safe_dump({"headline": {**SHOWN, **changed}}, sort_keys=False)
        )
        return read_contents(tmp_path)

    return tmp_path, shown


def test_arms_and_differences_are_drawn_seed_by_seed(published):
    _, shown = published
    arms, differences = shown().headline.figure().axes
    assert [label.get_text() for label in arms.get_yticklabels()] == ["with it", "without"]
    dots = [line.get_xdata().tolist() for line in arms.lines if line.get_marker() == "o"]
    assert dots == [[0.75, 1.0], [0.5, 0.5]]
    assert [text.get_text() for text in arms.texts] == ["0.88", "0.50"]
    assert [label.get_text() for label in differences.get_yticklabels()] == ["what it adds"]
    (dots,) = (line.get_xdata().tolist() for line in differences.lines if line.get_marker() == "o")
    assert dots == [0.25, 0.5]
    # The wider interval is Student's: .375 +- 12.71 * .125 with one degree of freedom.
    (low, high), *_ = (bar.get_segments()[0][:, 0] for bar in differences.collections)
    assert (low, high) == pytest.approx((0.375 - 1.5883, 0.375 + 1.5883), abs=1e-3)


def test_a_difference_may_be_of_another_experiment(published):
    root, shown = published
    for seed, ours, theirs in ((7, 1.0, 0.0), (8, 0.5, 0.25)):
        for arm, progress in (("later", ours), ("sooner", theirs)):
            write(root, "even", arm, seed, progress)
    (root / "even" / "README.md").write_text("# Even chains\n")
    found = shown(
        differences={"here": ["tstar", "buffer"], "there": ["later", "sooner"]}, beside={"there": "even"}
    )
    _, differences = found.headline.figure().axes
    dots = [line.get_xdata().tolist() for line in differences.lines if line.get_marker() == "o"]
    assert dots == [[0.25, 0.5], [1.0, 0.25]]


def test_two_experiments_may_have_an_arm_of_one_name(published):
    root, shown = published
    write(root, "even", "tstar", 3, 0.125)
    write(root, "even", "sooner", 3, 0.0)
    (root / "even" / "README.md").write_text("# Even chains\n")
    found = shown(differences={"there": ["tstar", "sooner"]}, beside={"there": "even"})
    arms, differences = found.headline.figure().axes
    assert next(line.get_xdata().tolist() for line in differences.lines if line.get_marker() == "o") == [
        0.125
    ]
    assert [text.get_text() for text in arms.texts] == ["0.88", "0.50"]


def test_the_page_draws_it_into_one_file(published, tmp_path):
    root, shown = published
    shown()
    assert root / "figures" / "headline.png" in draw_page(root, {"systems": {}}, root / "figures")
    assert (root / "figures" / "headline.png").is_file()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"arm": {}}, "headline has no arm; .*did you mean arms"),
        ({"differences": {"one": ["tstar"]}}, "headline.differences must be .*, got {'one': "),
        ({"differences": ["tstar"]}, "headline.differences must be"),
        ({"margin": "small"}, "headline.margin must be a number, got 'small'"),
        ({"beside": None}, "headline.beside must be"),
        ({"task": "chair"}, "odd has the tasks table; got 'chair'"),
        ({"arms": {"mine": "mine"}}, "no rows of mine; there are buffer, tstar"),
        (
            {"differences": {"one": ["tstar", "mine"]}},
            "headline: 'one' needs a seed of table that tstar and mine of .*odd both have",
        ),
        (
            {"beside": {"another": "odd"}},
            "headline: beside names 'another', which is none of its differences: 'what it adds'",
        ),
    ],
)
def test_mistakes_are_named(published, changed, message):
    _, shown = published
    with pytest.raises(ValueError, match=message):
        shown(**changed).headline.figure()


def test_it_may_be_left_out(published):
    root, _ = published
    contents(root, [{"folder": "odd", "kind": "experiment"}])
    assert read_contents(root).headline is None
    drawn = draw_page(root, {"systems": {}}, root / "figures")
    assert drawn and "headline.png" not in [path.name for path in drawn]
