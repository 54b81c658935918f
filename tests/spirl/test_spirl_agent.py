"""The agent of SPiRL on disk and on a device, and the bookkeeping of its run."""

import pandas as pd
import pytest
import torch
from spirl_agent import make_agent
from tensordict import TensorDict
from torch.testing import assert_close
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl import FurnitureEnv
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import NothingToDo
from tstar_rl.config.build import load_skill
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import read_config
from tstar_rl.spirl import (
    TRANSITION,
    LatentExecution,
    LatentPolicySettings,
    LatentPolicyUpdate,
    SpirlAgent,
    SpirlTraining,
)
from tstar_rl.transforms import RewardMixture


def test_an_agent_comes_back_from_disk(tmp_path):
    agent = make_agent("closed_loop")
    agent.normalizer.fit(torch.randn(50, 72) * 3)
    torch.nn.init.normal_(agent.network.mlp[0].weight)
    agent.save(tmp_path / "agent", recipe="spirl")
    found = load_skill(tmp_path / "agent", task="table_lack")
    assert isinstance(found, SpirlAgent)
    assert (found.settings, found.subtask, found.obs_dim) == (agent.settings, 0, 72)
    assert_close(acts(found), acts(agent))
    assert not torch.equal(acts(make_agent("closed_loop")), acts(agent))
    with pytest.raises(CheckpointMismatchError, match="subtask was 0 when it was saved, and is 1"):
        SpirlAgent.load(tmp_path / "agent", subtask=1)
    Skill("table_lack", 1, NetworkSettings(hidden=(8,))).save(tmp_path / "skill")
    assert isinstance(load_skill(tmp_path / "skill"), Skill)


def acts(agent: SpirlAgent) -> torch.Tensor:
    states = torch.randn(5, 72, generator=torch.Generator().manual_seed(0))
    steps = torch.zeros(5, 1, dtype=torch.int64)
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        return agent.policy(TensorDict({"observation": states, "step_count": steps}, [5]))["action"]


class TestSpirlTraining:
    """On `PointEnv`: three simulations, episodes of at most eight steps, latents of four."""

    def make(self, make_env, folder, **changes) -> SpirlTraining:
        config = {
            "task": {"name": "table_lack"},
            "system": "spirl",
            "seed": 0,
            "subtask": 0,
            "results_dir": str(folder / "results"),
            "runs_dir": str(folder / "runs"),
            "resume": True,
            "progress_bar": False,
            "collection": {"backend": "local"},
            "spirl": {"total_steps": 30, "checkpoint_every": 1000},
        }
        agent = make_agent()
        env = with_starts(make_env())
        env.append_transform(LatentExecution(agent.model.decoder, 3, 4))
        return SpirlTraining({**config, **changes}, agent, env, seed=5)

    def latents(self, training: SpirlTraining) -> torch.Tensor:
        """Plays the whole run; the latents that were drawn."""
        latents = []
        for rollout in training.rollouts():
            rollout = RewardMixture({"env": 1.0})(rollout)
            training.log(rollout, {"loss_actor": 0.5})
            latents.append(rollout["latent"])
        return torch.cat(latents, 1)

    def test_it_counts_environment_steps_until_the_budget_is_spent(self, make_env, tmp_path):
        training = self.make(make_env, tmp_path)
        training.log_model({"model_loss_prior": 1.0})
        latents = self.latents(training)
        table = pd.read_csv(training.run.results / "metrics.csv")
        # Three simulations, four steps a latent: twelve steps a rollout, while no episode ends within a latent.
        assert table.env_steps.tolist() == [0, 12, 24, 36] and latents.shape == (3, 3, 3)
        assert table.model_loss_prior.notna().tolist() == [True, False, False, False]
        assert table.loss_actor.tolist()[1:] == [0.5] * 3
        record = checkpoint.read_record(training.run.work / "last")
        assert record["env_steps"] == 36 and record["recipe"] == "spirl"
        assert (training.run.work / "finished.json").is_file()

    def test_steps_after_an_episodes_end_are_not_counted(self, make_env, tmp_path):
        """Of six steps an episode has a latent of four and one of two."""
        training = self.make(lambda: make_env(max_steps=6), tmp_path)
        self.latents(training)
        assert pd.read_csv(training.run.results / "metrics.csv").env_steps.tolist() == [12, 18, 30]

    def test_a_rollout_that_is_not_logged_is_an_error(self, make_env, tmp_path):
        training = self.make(make_env, tmp_path)
        rollouts = training.rollouts()
        next(rollouts)
        with pytest.raises(RuntimeError, match="must log each rollout"):
            next(rollouts)
        assert not (training.run.work / "last").exists()

    def test_the_second_stage_draws_the_same_whatever_the_first_drew(self, make_env, tmp_path):
        first, second = (self.make(make_env, tmp_path / name) for name in "ab")
        expected = self.latents(first)
        torch.randn(99)
        assert torch.equal(self.latents(second), expected)

    def test_one_that_goes_on_to_more_steps_ends_like_one_that_had_them_at_once(self, tmp_path):
        def make_env() -> FurnitureEnv:  # whose simulations a checkpoint has
            return FurnitureEnv("table_lack", 3, 0, seed=0, max_steps=8)

        budgets = [{"total_steps": steps, "checkpoint_every": 12} for steps in (24, 48)]
        at_once = self.latents(self.make(make_env, tmp_path / "a", spirl=budgets[1]))
        self.latents(self.make(make_env, tmp_path / "b", spirl=budgets[0]))
        training = self.make(make_env, tmp_path / "b", spirl=budgets[1])
        assert training.steps == 24 and not training.is_new
        assert torch.equal(self.latents(training), at_once[:, 2:])
        assert training.steps == 48
        assert read_config(training.run.results)["spirl"] == budgets[1]

    def test_one_whose_config_said_that_its_normaliser_runs_goes_on(self, tmp_path):
        """It never ran: what the scale said was not read."""

        def train(steps: int, running: bool) -> SpirlTraining:
            training = self.make(
                lambda: FurnitureEnv("table_lack", 3, 0, seed=0, max_steps=8),
                tmp_path,
                recipe="spirl",
                normalizer={"running": running, "floor": 0.01},
                spirl={"total_steps": steps, "checkpoint_every": 12},
            )
            assert training.is_new == (steps == 24)
            self.latents(training)
            return training

        train(24, running=True)
        with pytest.raises(NothingToDo):
            train(24, running=False)
        for steps in (48, 60):  # the second one from a checkpoint that says what is so
            training = train(steps, running=False)
        assert training.steps == 60
        begun = read_config(training.run.results)["normalizer"]
        assert begun == {"running": True, "floor": 0.01}, "it tells how the run began"

    def test_the_best_agent_is_kept(self, make_env, tmp_path):
        training = self.make(make_env, tmp_path)
        for rollout, completed in zip(training.rollouts(), (0, 1, 0), strict=True):
            rollout["next", "done"][:] = True
            rollout["next", "completed"][:] = completed
            training.log(RewardMixture({"env": 1.0})(rollout), {})
        assert checkpoint.read_record(training.run.work / "best")["env_steps"] == 24
        assert checkpoint.read_record(training.run.work / "last")["env_steps"] == 36

    def test_a_cluster_is_refused(self, make_env, tmp_path):
        with pytest.raises(ValueError, match="collection.backend=local only, got 'ray'"):
            self.make(make_env, tmp_path, collection={"backend": "ray"})


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def test_latents_are_learned_on_the_simulator_of_the_gpu_and_resumed(device, tmp_path):
    """Warp also has a CPU device, so that this runs without a GPU too."""
    pytest.importorskip("mujoco_warp", reason="mujoco_warp is not installed: pip install -e '.[gpu]'")
    env = FurnitureEnv("table_lack", 2, 0, seed=0, device=device, physics="warp", max_steps=3)
    env = with_starts(env)
    settings = LatentPolicySettings(critic_hidden=(16,), first=2, minibatch=4)

    def new() -> dict:
        agent = make_agent(horizon=2).to(device)
        update = LatentPolicyUpdate(agent, settings)
        return {
            "agent": agent,
            "update": update,
            "buffer": TensorDictReplayBuffer(storage=LazyTensorStorage(8)),
        }

    run, resumed = new(), new()
    env.append_transform(LatentExecution(run["agent"].model.decoder, 3, 2))
    collection = Collection(env, run["agent"].actor, 2)
    rollout = RewardMixture({"env": 1.0})(collection.rollout())
    assert rollout["next", "done"][:, 1].all() and rollout["latent"].device.type == device
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
