"""Curves of training: a line has one look in all panels of a figure, and the legend names every line."""

import pandas as pd

from tstar_rl.analysis import ablation_curves, learning_curves, seed_curves


def looks(figure) -> dict[str, set[tuple[str, str]]]:
    """Colour and dashes of the lines of each name, over all panels."""
    found = {}
    for axes in figure.axes:
        for line in axes.lines:
            if not line.get_label().startswith("_"):
                found.setdefault(line.get_label(), set()).add((line.get_color(), str(line.get_linestyle())))
    return found


def named(figure) -> list[str]:
    return [
        text.get_text() for axes in figure.axes if axes.get_legend() for text in axes.get_legend().get_texts()
    ]


def test_a_variant_that_lacks_the_first_skills_panel_keeps_its_colour():
    rows = [
        {
            "task": "table",
            "skill": skill,
            "variant": variant,
            "seed": 0,
            "env_steps": step,
            "success_rate": 0.5,
        }
        for variant, skills in (("two", (0, 1)), ("three", (0, 1, 2)), ("last", (2,)))
        for skill in skills
        for step in (1, 2)
    ]
    metrics = pd.DataFrame(rows)
    metrics["variant"] = pd.Categorical(
        metrics["variant"], ["never run", "two", "three", "last"], ordered=True
    )
    figure = ablation_curves(metrics)
    assert {name: len(found) for name, found in looks(figure).items()} == {"two": 1, "three": 1, "last": 1}
    assert len(set.union(*looks(figure).values())) == 3
    assert named(figure) == ["two", "three", "last"]


def test_24_seeds_are_told_apart_and_named_though_the_first_panel_lacks_some():
    rows = [
        {"seed": seed, "panel": panel, "env_steps": step, "success_rate": 0.5}
        for panel, seeds in (("a", range(2)), ("b", range(24)))
        for seed in seeds
        for step in (1, 2)
    ]
    figure = seed_curves(pd.DataFrame(rows), {"success_rate": "seed"}, "panel")
    found = looks(figure)
    assert sorted(named(figure)) == sorted(found) == sorted(f"seed {seed}" for seed in range(24))
    assert all(len(each) == 1 for each in found.values()) and len(set.union(*found.values())) == 24


def test_runs_beside_each_other_are_told_apart():
    rows = [
        {
            "task": "table",
            "recipe": "tstar",
            "subtask": -1,
            "seed": seed,
            "skill": skill,
            "env_steps": step,
            "kl": 0.1,
        }
        for seed in (0, 1, 2)
        for skill in range(4)
        for step in (1, 2)
    ]
    found = looks(learning_curves(pd.DataFrame(rows), ["kl"]))
    assert len(found) == len(set.union(*found.values())) == 12
