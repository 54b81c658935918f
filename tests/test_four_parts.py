"""A piece of furniture of four parts, added as data alone, goes all the way: world, demonstrations, skill, updates."""

import math
from pathlib import Path

import pytest
import torch
import yaml
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig
from torchrl.envs import Compose

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import (
    environment,
    load_demonstrations,
    new_skill,
    new_spirl_agent,
)
from tstar_rl.config.demonstrations import demonstrations_path
from tstar_rl.config.values import CONFIGS
from tstar_rl.demonstrations.collect import collect
from tstar_rl.env.layout import observation_size
from tstar_rl.rollouts.collection import Collection
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.spirl import SpirlAgent
from tstar_rl.transforms import GAILReward, RewardMixture
from tstar_rl.updates import (
    BehaviourCloningSettings,
    DiscriminatorSettings,
    DiscriminatorUpdate,
    PolicyUpdate,
    PPOSettings,
    behaviour_cloning,
)

NAME, SIZE = "stool_of_three_legs", 65
SMALL = [f"task.name={NAME}", "task.subtasks=3", "networks.hidden=[16]", "networks.discriminator_hidden=[16]"]


@pytest.fixture(scope="module", autouse=True)
def stool(tmp_path_factory):
    """The table less a leg, as one more file in the library."""
    from tstar_envs.furniture import library

    data = yaml.safe_load((library.DATA / "table_lack.yaml").read_text())
    del data["parts"][data["steps"].pop()["moving_part"]]
    folder = tmp_path_factory.mktemp("data")
    (folder / f"{NAME}.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(library, "DATA", folder)
        yield
    library._load.cache_clear()


def config(folder: Path, recipe: str = "gail_ppo", *values: str) -> DictConfig:
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(f"recipe/{recipe}", [*SMALL, f"demonstrations_dir={folder}", *values])


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> DictConfig:
    """A config, and four demonstrations of the first step where it looks for them."""
    few = ("demonstrations.episodes=4", "demonstrations.noise=0.05")
    values = config(tmp_path_factory.mktemp("demonstrations"), "gail_ppo", *few)
    found = collect(lambda seed: environment(values, 0, 6, seed, snapshots=True), 4, "noisy", 0.05, 0)
    found.save(demonstrations_path(values, 0, "noisy"))
    return values


def test_a_skill_is_trained(made, tmp_path):
    expert = load_demonstrations(made, 0)
    assert expert.observations.shape[1] == SIZE == observation_size(4) and expert.noise == 0.05
    skill = new_skill(made, 0)
    skill.normalizer.fit(expert.observations)
    behaviour_cloning(
        skill.policy, expert.observations, expert.actions, BehaviourCloningSettings(epochs=1), 0
    )
    rollout = Collection(environment(made, 0, 4, 0), skill.policy, 16).rollout()
    assert rollout["observation"].shape == (4, 16, SIZE)
    labels = {"expert": 1.0, "agent": -1.0}
    update_f_phi = DiscriminatorUpdate("f_phi", skill.f_phi, labels, DiscriminatorSettings(steps=2))
    log = update_f_phi(expert=expert.observations, agent=rollout["observation"])
    reward = Compose(GAILReward(skill.f_phi), RewardMixture())
    before = skill.network_state()["policy"]
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(minibatch=32), skill.return_scale)
    log |= update(reward(rollout), 0.0)
    assert all(math.isfinite(value) for value in log.values())
    assert any(not torch.equal(value, before[key]) for key, value in skill.policy.state_dict().items())
    skill.save(tmp_path / "skill")
    back = Skill.load(tmp_path / "skill")
    assert back.obs_dim == SIZE
    assert torch.equal(back.f_phi(expert.observations), skill.f_phi(expert.observations))


def test_a_chain_runs_and_its_sets_are_started_from(made):
    skills = [new_skill(made, subtask) for subtask in range(3)]
    run_episodes(environment(made, None, 2, 0, max_steps=2), ChainPolicy(skills))
    expert = load_demonstrations(made, 0)
    env = environment(made, 0, 1, 0)
    env.base_env.restore(expert.snapshots[5:6])
    assert torch.allclose(env.base_env.world.observation().float(), expert.observations[5:6], atol=1e-6)


def test_an_agent_of_spirl_acts(made, tmp_path):
    values = config(tmp_path, "spirl", "spirl.model.hidden=[16]", "spirl.policy.critic_hidden=[16]")
    agent = new_spirl_agent(values, 0)
    last = run_episodes(environment(values, 0, 2, 0, max_steps=2), agent.policy)
    assert last["observation"].shape == (2, SIZE)
    agent.save(tmp_path / "agent")
    assert SpirlAgent.load(tmp_path / "agent").obs_dim == SIZE


def test_observations_of_other_furniture_are_refused_by_name(made):
    with pytest.raises(ValueError, match="observations of 65 numbers are normalised here, got 72"):
        new_skill(made, 0).normalizer.fit(torch.zeros(9, 72))
