"""What trains stays on one device, whichever: run on torch's device without data, where a tensor left on the CPU fails.

It needs no GPU. Numbers are made up where the host reads one, so this tells nothing of values.
"""

import shutil

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import Compose

from tstar_rl import FurnitureEnv
from tstar_rl.chaining.skill import Skill
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.runs import checkpoint
from tstar_rl.transforms import GAILReward, RewardMixture, TerminalStateReward
from tstar_rl.updates import (
    BehaviourCloningSettings,
    DiscriminatorSettings,
    DiscriminatorUpdate,
    PolicyUpdate,
    PPOSettings,
    behaviour_cloning,
)

F_PHI = {"expert": 1.0, "agent": -1.0}

N, T = 4, 8
FAST = {"learning_rate": 0.05, "kl_stop": 0.01}


@pytest.fixture
def elsewhere(monkeypatch):
    """A device without data. What the host would read of it is made up: a number 0.5, a truth False."""
    generator, adam = torch.Generator, torch.optim.Adam
    monkeypatch.setattr(torch.optim, "Adam", lambda parameters, fused=False, **rest: adam(parameters, **rest))
    monkeypatch.setattr(torch, "Generator", lambda device="cpu": generator())
    monkeypatch.setattr(torch.Tensor, "__float__", lambda self: 0.5)
    monkeypatch.setattr(torch.Tensor, "__bool__", lambda self: False)
    return torch.device("meta")


def new_skill(device: torch.device) -> Skill:
    settings = NetworkSettings(hidden=(16,), discriminator_hidden=(16,), std="fixed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.Tensor, "__bool__", lambda self: True)  # its checks pass
        return Skill("table_lack", 0, settings).to(device)


def new_rollout(device: torch.device) -> TensorDict:
    def flags() -> torch.Tensor:
        return torch.zeros(N, T, 1, dtype=torch.bool, device=device)

    following = {name: flags() for name in ("done", "terminated", "truncated", "success")}
    following |= {
        "observation": torch.zeros(N, T, 72, device=device),
        "reward_env": torch.zeros(N, T, 1, device=device),
    }
    rows = {
        "observation": torch.zeros(N, T, 72, device=device),
        "action": torch.zeros(N, T, 9, device=device),
        "action_log_prob": torch.zeros(N, T, device=device),
        "next": TensorDict(following, [N, T]),
    }
    return TensorDict(rows, [N, T], device=device)


def ended_rollout(device: str) -> TensorDict:
    """Made up: simulation 0 succeeds in its fourth step, and simulation 1 is out of time after its fifth."""
    rollout = new_rollout(torch.device(device))
    for key in ("observation", ("next", "observation"), ("next", "reward_env")):
        rollout[key] = torch.randn_like(rollout[key])
    for row, step, names in ((0, 3, ("success", "terminated")), (1, 4, ("truncated",))):
        for name in ("done", *names):
            rollout["next", name][row, step] = True
    return rollout


def test_an_update_of_everything(elsewhere):
    skill, rollout = new_skill(elsewhere), new_rollout(elsewhere)
    discriminator = DiscriminatorSettings(minibatch=8, steps=2)
    observations = torch.zeros(32, 72, device=elsewhere)
    reward = Compose(
        GAILReward(skill.f_phi),
        TerminalStateReward(skill.d_omega),
        RewardMixture({"env": 0.5, "gail": 0.5, "tsr": 1.0}),
    )
    ppo = PPOSettings(epochs=1, minibatch=16, normalize_returns=True, kl_stop=1.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.Tensor, "__bool__", lambda self: True)  # it has a critic
        update = PolicyUpdate(skill.policy, skill.value, ppo, skill.return_scale)
    cloning = BehaviourCloningSettings(epochs=1, minibatch=16)
    behaviour_cloning(skill.policy, observations, torch.zeros(32, 9, device=elsewhere), cloning)
    update_f_phi = DiscriminatorUpdate("f_phi", skill.f_phi, F_PHI, discriminator)
    update_f_phi(expert=observations, agent=rollout["observation"])
    log = update(reward(rollout))
    skill.normalizer.update(rollout["observation"])
    assert log["actor_steps"] == log["critic_steps"] == 2


@pytest.fixture
def selects_all(monkeypatch):
    """Makes a mask without data choose every row: what is behind `mask.any()` runs too, and must be on its device."""
    get, put = torch.Tensor.__getitem__, torch.Tensor.__setitem__

    def chosen(rows, index):
        if not (isinstance(index, torch.Tensor) and index.dtype == torch.bool):
            return get(rows, index)
        assert rows.device == index.device
        return rows.flatten(0, index.ndim - 1)

    def write(rows, index, value):
        if not (isinstance(index, torch.Tensor) and index.dtype == torch.bool):
            return put(rows, index, value)
        assert rows.device == index.device == value.device

    def believing(method):
        def run(*arguments):
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(torch.Tensor, "__bool__", lambda self: True)
                return method(*arguments)

        return run

    monkeypatch.setattr(torch.Tensor, "__getitem__", chosen)
    monkeypatch.setattr(torch.Tensor, "__setitem__", write)
    monkeypatch.setattr(TerminalStateReward, "reward", believing(TerminalStateReward.reward))
    monkeypatch.setattr(PolicyUpdate, "_with_values", believing(PolicyUpdate._with_values))


def parts(skill: Skill, **settings) -> tuple[Compose, PolicyUpdate]:
    """The reward of a chained skill, scored by its own d_omega, and the update of its policy."""
    terminal = TerminalStateReward(skill.d_omega, baseline="running_mean")
    reward = Compose(GAILReward(skill.f_phi), terminal, RewardMixture({"env": 0.5, "gail": 0.5, "tsr": 1.0}))
    settings = PPOSettings(epochs=2, minibatch=16, normalize_returns=True, **settings)
    return reward, PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)


def test_successes_and_truncations(elsewhere, selects_all):
    skill = new_skill(elsewhere)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.Tensor, "__bool__", lambda self: True)  # it has a critic
        reward, update = parts(skill, kl_stop=0.4)  # every number is 0.5
    log = update(reward.to(elsewhere)(new_rollout(elsewhere)))
    assert log["actor_steps"] == 0 and log["critic_steps"] == 4


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def test_an_update_with_ends_goes_on_from_its_checkpoint(device, tmp_path):
    """A success and a truncation in the rollout, an actor that a KL stops; then the same again from what was saved."""
    torch.manual_seed(0)
    first, second = (Skill("table_lack", 0, NetworkSettings(hidden=(16,))).to(device) for _ in range(2))
    with torch.no_grad():
        rollouts = [first.policy(ended_rollout(device)) for _ in range(2)]
    works = [dict(zip(("reward", "update"), parts(skill, **FAST), strict=True)) for skill in (first, second)]
    rewarded = works[0]["reward"](rollouts[0])
    paid = rewarded["next", "reward_tsr"].squeeze(-1)
    assert ((paid != 0) <= rewarded["next", "success"].squeeze(-1)).all() and paid.isfinite().all()
    log = works[0]["update"](rewarded)
    assert 0 < log["actor_steps"] < log["critic_steps"] == 4 and log["kl"] > FAST["kl_stop"]
    checkpoint.save(tmp_path / "a", {"skill": first, **works[0]}, {})
    checkpoint.load(tmp_path / "a", {"skill": second, **works[1]})
    logs = []
    for skill, work in zip((first, second), works, strict=True):
        logs.append(work["update"](work["reward"](rollouts[1].clone())))
        assert all(value.device.type == device for value in skill.policy.state_dict().values())
    assert logs[0] == pytest.approx(logs[1], rel=1e-5)


def test_a_tensor_elsewhere_is_found(elsewhere):
    skill, rollout = new_skill(elsewhere), new_rollout(elsewhere)
    with pytest.raises((RuntimeError, NotImplementedError)):
        skill.policy(rollout.clear_device_().set("observation", torch.zeros(N, T, 72)))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="torch.compile needs a C++ compiler: g++ is not here")
def test_a_compiled_update_does_what_an_eager_one_does(make_env):
    states, logs = [], []
    for mode in (None, "default"):
        torch.manual_seed(0)
        skill = Skill("table_lack", 0, NetworkSettings(hidden=(16,), std="fixed"))
        env = with_starts(make_env(num_envs=16, snapshots=False))
        rollout = Collection(env, skill.policy, 8).rollout()
        rollout = RewardMixture({"env": 0.5})(rollout)
        settings = PPOSettings(epochs=2, minibatch=32, kl_stop=0.05, compile=mode)
        logs.append(PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)(rollout))
        states.append(skill.network_state())
    assert logs[0] == pytest.approx(logs[1], rel=1e-3, abs=1e-6)
    torch.testing.assert_close(states[0], states[1], rtol=1e-4, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def test_training_on_the_simulator_of_the_gpu(device):
    """Warp has a CPU device: there this runs everywhere, and on a GPU where there is one."""
    pytest.importorskip("mujoco_warp", reason="mujoco_warp is not installed: pip install -e '.[gpu]'")
    skill = Skill("table_lack", 0, NetworkSettings(hidden=(16,), std="fixed")).to(device)
    env = FurnitureEnv("table_lack", 2, 0, seed=0, device=device, physics="warp", snapshots=True, max_steps=2)
    collection = Collection(with_starts(env), skill.policy, 3)
    rollout = collection.rollout()
    skill.initiation_set.extend(rollout[:, -1].select("observation"))
    skill.termination_set.extend(rollout["next"][:, -1].select("observation", "snapshot"))
    collection.settle()
    update_f_phi = DiscriminatorUpdate(
        "f_phi", skill.f_phi, F_PHI, DiscriminatorSettings(minibatch=4, steps=1)
    )
    update_f_phi(expert=rollout["observation"], agent=rollout["observation"])
    rollout = Compose(GAILReward(skill.f_phi), RewardMixture())(rollout)
    log = PolicyUpdate(skill.policy, skill.value, PPOSettings(minibatch=4), skill.return_scale)(rollout)
    assert log["critic_steps"] == 20 and rollout["next", "done"][:, 1].all()
    for rows in (rollout, skill.initiation_set.all(), skill.termination_set.all()):
        assert all(value.device.type == device for value in rows.values(True, True))
    assert collection.rollout()["observation"].isfinite().all()
