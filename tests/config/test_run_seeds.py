"""What a run draws is drawn with its own seed: otherwise the seeds of an experiment would be copies of one run."""

import shutil

import pytest
import torch
from hydra import compose, initialize_config_dir
from recipe_runs import load_recipe

from tstar_rl.chaining.turns import Turn
from tstar_rl.config.build import new_skill, new_spirl_agent
from tstar_rl.config.values import CONFIGS
from tstar_rl.demonstrations.file_check import KINDS
from tstar_rl.seeds import derive_seed


def made_with(worlds) -> list[tuple[int | None, int]]:
    """The subtask and the seed of each."""
    return [(world.subtask, world.seed) for world in worlds]


class Nothing:
    """Stands for demonstrations."""

    def __len__(self) -> int:
        return 0

    def save(self, path) -> None:
        pass


@pytest.mark.parametrize(("recipe", "make"), [("gail_ppo", new_skill), ("spirl", new_spirl_agent)])
def test_initial_weights(recipe, make):
    weights = []
    for seed in (0, 5, 5):
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            config = compose(f"recipe/{recipe}", ["scale=quick", f"seed={seed}"])
        weights.append(torch.nn.utils.parameters_to_vector(make(config, 0).policy.parameters()).detach())
    assert torch.equal(weights[1], weights[2]) and not torch.equal(weights[0], weights[1])


def test_a_skill_in_training(point_chain, worlds):
    point_chain("gail_ppo", "training.total_steps=512", "seed=5")
    assert made_with(worlds) == [(None, derive_seed(5, "train", None))]


def test_a_chain_its_trials_and_its_turns_which_have_their_own_limits(
    point_chain, worlds, monkeypatch, tmp_path
):
    skills = tmp_path / "runs/table_lack/gail_ppo"
    shutil.copytree(skills / "seed0", skills / "seed5")
    drawn, rollouts = [], Turn.rollouts

    def noted(turn):
        drawn.append(torch.initial_seed())
        return rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", noted)
    limits = ("training.max_steps=9", "chain.trial_max_steps=7")
    point_chain("tstar", "seed=5", "chain.gate=true", "chain.links=2", "chain.steps_per_turn=512", *limits)
    before, tried = ((None, derive_seed(5, purpose)) for purpose in ("harvest", "validate"))
    turns = [derive_seed(5, "chain", index) for index in range(2)]
    first, second = enumerate(turns)
    assert made_with(worlds) == [before, first, tried, tried, second, tried] and drawn == turns
    assert [world.max_steps for world in worlds] == [7, 9, 7, 7, 9, 7]


def test_demonstrations_have_the_seed_of_their_subtask_and_kind(tmp_path):
    recipe, seeds = load_recipe("make_demonstrations"), []
    recipe.collect = lambda *values: seeds.append(values[4]) or Nothing()
    values = [
        "scale=quick",
        "subtask=1",
        "kinds=[noisy]",
        "seed=5",
        f"demonstrations_dir={tmp_path}",
        "progress_bar=false",
    ]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        recipe.main.__wrapped__(compose("recipe/make_demonstrations", values))
    assert seeds == [derive_seed(5, "demonstrate", 1, KINDS.index("noisy"))]
