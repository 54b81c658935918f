"""What SPiRL's agent keeps of itself, and that it learns wherever its tensors are."""

import pytest
import torch
from spirl_agent import make_agent
from tensordict import TensorDict
from torch.testing import assert_close
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl import FurnitureEnv
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.runs import checkpoint
from tstar_rl.spirl.agent import SkillAgent
from tstar_rl.spirl.skill_execution import SkillExecution
from tstar_rl.spirl.update_policy import TRANSITION, SkillPolicySettings, SkillPolicyUpdate
from tstar_rl.transforms import RewardMixture


def acts(agent: SkillAgent) -> torch.Tensor:
    states = torch.randn(5, 72, generator=torch.Generator().manual_seed(0))
    steps = torch.zeros(5, 1, dtype=torch.int64)
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        return agent.policy(TensorDict({"observation": states, "step_count": steps}, [5]))["action"]


def test_the_untrained_critic_is_not_saved_and_agents_that_hold_one_are_read(tmp_path, monkeypatch):
    agent, other = make_agent(), make_agent()
    torch.nn.init.normal_(agent.network.mlp[0].weight)
    agent.save(tmp_path / "new")
    assert set(agent.state_dict()) == {"model", "network"}
    assert_close(acts(SkillAgent.load(tmp_path / "new")), acts(agent))

    old = {**agent.state_dict(), "critic": dict(agent.critic.state_dict())}
    monkeypatch.setattr(agent, "state_dict", lambda: old)
    agent.save(tmp_path / "old")
    assert not torch.equal(acts(other), acts(agent))
    assert_close(acts(SkillAgent.load(tmp_path / "old")), acts(agent))


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def test_skills_are_learnt_on_the_simulator_of_the_gpu_and_resumed(device, tmp_path):
    """Warp has a CPU device: there this runs everywhere, and on a GPU where there is one."""
    pytest.importorskip("mujoco_warp", reason="mujoco_warp is not installed: pip install -e '.[gpu]'")
    env = FurnitureEnv("table_lack", 2, 0, seed=0, device=device, physics="warp", max_steps=3)
    env = with_starts(env)
    settings = SkillPolicySettings(first=2, minibatch=4)

    def new() -> dict:
        agent = make_agent(horizon=2).to(device)
        update = SkillPolicyUpdate(agent.actor, agent.critic, agent.model.prior, settings)
        return {
            "agent": agent,
            "update": update,
            "buffer": TensorDictReplayBuffer(storage=LazyTensorStorage(8)),
        }

    run, resumed = new(), new()
    env.append_transform(SkillExecution(run["agent"].model.decoder, 3, 2))
    collection = Collection(env, run["agent"].actor, 2)
    rollout = RewardMixture({"env": 1.0})(collection.rollout())
    assert rollout["next", "done"][:, 1].all() and rollout["skill"].device.type == device
    run["buffer"].extend(rollout.select(*TRANSITION).reshape(-1))
    assert run["update"](run["buffer"], 4)["loss_qvalue"] > 0
    checkpoint.save(tmp_path / "a", run, {})
    checkpoint.load(tmp_path / "a", resumed)
    logs = []
    for each in (run, resumed):
        torch.manual_seed(0)
        logs.append(each["update"](each["buffer"], 4))
    assert logs[0] == pytest.approx(logs[1])
    collection.close()
