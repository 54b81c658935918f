"""A training's memory does not grow with its rollouts."""

import gc
import warnings

import torch
from hydra import compose, initialize_config_dir

from tstar_rl.config.build import make_collection, new_skill
from tstar_rl.config.values import CONFIGS
from tstar_rl.rollouts.collection import Collection


def small_collection() -> Collection:
    values = ["training.num_envs=2", "training.horizon=4", "training.max_steps=6"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/gail_ppo", values)
    return make_collection(config, new_skill(config, 0).policy, 0, seed=0)


def numbers_alive() -> int:
    """Of all tensors that anything still holds."""
    for _ in range(3):  # what a finaliser lets go of is for the next one
        gc.collect()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch warns when it is asked for some of its own objects
        return sum(each.numel() for each in gc.get_objects() if isinstance(each, torch.Tensor))


def test_a_collection_keeps_nothing_of_the_rollouts_that_it_gave():
    collection = small_collection()
    for _ in range(3):  # the first ones fill what is kept for good
        collection.rollout()
    before = numbers_alive()
    for _ in range(12):
        collection.rollout()
    assert numbers_alive() <= before  # what an earlier test has left may be freed meanwhile
    before = numbers_alive()
    held = collection.rollout()
    assert numbers_alive() >= before + held["observation"].numel()
    collection.close()
