"""Which of two skills mended a seam, on chains of a point where that is known."""

from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
import torch
from point_chain import PointChain, make_skills
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, exploration_type

from tstar_rl.analysis.figures.seams import exchanged_figure
from tstar_rl.chaining.skill import Skill
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.starts import make_starts
from tstar_rl.seams.exchange import exchange_skills, run_from

EPISODES = 64


def make_env(subtask, number, starts):
    env = PointChain("point", number, subtask, seed=5, snapshots=True, max_steps=30)
    return (
        with_starts(env)
        if starts is None
        else with_starts(env, *make_starts({"buffer": 1.0}, env, starts), 0)
    )


def chain(folder: Path, **sideways: float) -> list[Skill]:
    """Skills that walk forward; skill<i>=a also moves across the way, y by 0.3 tanh(a) a step."""
    make_skills(folder)
    skills = [Skill.load(folder / f"runs/table_lack/gail_ppo/seed0/subtask{i}/last") for i in range(4)]
    for name, speed in sideways.items():
        skills[int(name.removeprefix("skill"))].policy[0][1].module[0][-1].bias.data[1] = speed
    return skills


def table(found) -> dict[tuple, float]:
    return {(each.subtask, each.handed_by, each.taken_by): each.taken / each.handed for each in found}


def test_the_first_skill_mended_it(tmp_path):
    """Skill 1 succeeds where y > 0. Fine-tuned, skill 0 ends there; skill 1 is as it was."""
    found = exchange_skills(chain(tmp_path), chain(tmp_path, skill0=3.0), make_env, EPISODES)
    success = table(found)
    assert len(found) == 12 and all(each.handed == EPISODES for each in found if each.subtask == 1)
    for taken_by in ("before", "after"):
        assert 0.3 < success[1, "before", taken_by] < 0.7 < 0.9 < success[1, "after", taken_by]


def test_the_second_skill_mended_it(tmp_path):
    success = table(exchange_skills(chain(tmp_path), chain(tmp_path, skill1=3.0), make_env, EPISODES))
    for handed_by in ("before", "after"):
        assert success[1, handed_by, "before"] + 0.2 < success[1, handed_by, "after"]


def test_later_seams_begin_where_the_chain_arrives_after_fine_tuning(tmp_path):
    """The point gets through seam 1 in more episodes after fine-tuning, and all four ways of seam 2 have these."""
    before, after = chain(tmp_path), chain(tmp_path, skill0=3.0)
    found = exchange_skills(before, after, make_env, EPISODES)
    assert len({each.episodes for each in found if each.subtask == 2}) == 1
    assert found[4].episodes == found[3].handed == EPISODES and found[4].subtask == 2
    assert found[8].episodes == found[7].handed > 0.9 * EPISODES


def test_chains_of_other_lengths_are_told_before_anything_is_run(tmp_path):
    skills = chain(tmp_path)
    with pytest.raises(ValueError, match="must have the same skills, got 2 and 4: chain.links"):
        exchange_skills(skills[:2], skills, lambda *given: pytest.fail("it ran"), EPISODES)


def test_nothing_is_run_from_no_states(tmp_path):
    nothing = TensorDict({"snapshot": TensorDict(batch_size=[0])}, [0])
    assert not run_from(make_env, 1, chain(tmp_path)[1], nothing, 5).batch_size[0]


@pytest.mark.parametrize("seeds", [1, 3])
def test_the_figure_has_a_bar_for_each_way_and_a_line_for_each_seed(seeds):
    rows = [
        {
            "system": system,
            "seed": seed,
            "subtask": seam,
            "handed_by": first,
            "taken_by": second,
            "success": 0.5,
        }
        | {"success_low": 0.4, "success_high": 0.6}
        for system in ("tstar", "policy_sequencing")
        for seed in range(seeds)
        for seam in (1, 2, 3)
        for first in ("before", "after")
        for second in ("before", "after")
    ]
    figure = exchanged_figure(pd.DataFrame(rows))
    assert len(figure.axes) == 6
    for axes in figure.axes:
        bars = [patch for patch in axes.patches if patch.get_height() == 0.5]
        lines = [line for line in axes.lines if line.get_label().startswith("seed ")]
        assert len(bars) == 4 and [len(line.get_xdata()) for line in lines] == [2] * (0 if seeds == 1 else 6)
    assert "no table yet" in exchanged_figure(pd.DataFrame()).axes[0].texts[0].get_text()


def test_no_action_is_drawn():
    used = set()

    def act(tensordict):
        used.add(exploration_type())
        return tensordict.set("action", torch.ones(len(tensordict), 9))

    run_from(make_env, 0, SimpleNamespace(policy=act), None, 4)
    assert used == {ExplorationType.DETERMINISTIC}
