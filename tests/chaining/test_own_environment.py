"""A chain on an environment of a user's own, with observations and actions of other sizes: docs/library.md."""

from types import SimpleNamespace

import pytest
import torch
from point_chain import PointChain
from saved_run import a_run
from torchrl.data import Bounded, Unbounded

import tstar_rl as rl
from tstar_rl.chaining.turns import chain_turns
from tstar_rl.runs import checkpoint

OBSERVED, ACTIONS = 10, (2, 1)


class Pushing(PointChain):
    """The point chain as another robot would have it: ten numbers are seen, three are given."""

    def __init__(self, num_envs: int, subtask: int | None, seed: int) -> None:
        super().__init__("push", num_envs, subtask, seed, snapshots=True)
        self.observation_spec["observation"] = Unbounded((num_envs, OBSERVED))
        self.action_spec = Bounded(-1, 1, (num_envs, sum(ACTIONS)))

    def _out(self, *ended):
        out = super()._out(*ended)
        out["observation"] = out["observation"][:, :OBSERVED]
        return out


class Workshop:
    """What makes the chain's environments."""

    def turn_seed(self, turn: int) -> int:
        return turn

    def collection(self, skill, seed, before):
        env = Pushing(8, skill.subtask, seed)
        if before is None:
            return rl.Collection(rl.with_starts(env), skill.policy, 4)
        starts = rl.make_starts({"environment": 0.2, "buffer": 0.8}, env, before)
        return rl.Collection(rl.with_starts(env, *starts, seed), skill.policy, 4)

    def trial(self):
        return rl.with_starts(Pushing(8, None, 3))

    seeding_trial = trial


def test_turns_train_it_and_its_skills_come_back(tmp_path):
    networks = rl.NetworkSettings(hidden=(8,), discriminator_hidden=(8,), std="fixed")
    skills = [rl.Skill("push", k, networks, capacity=32, obs_dim=OBSERVED, actions=ACTIONS) for k in range(4)]
    for skill in skills:
        skill.policy[0][1].module[0][-1].bias.data[0] = 2.0  # it walks to where its subtask ends
    expert = SimpleNamespace(observations=torch.rand(8, OBSERVED), actions=torch.zeros(8, sum(ACTIONS)))
    workshop = Workshop()
    folders = {"results_dir": str(tmp_path / "results"), "runs_dir": str(tmp_path / "runs")}
    run = rl.Run(
        {
            "task": {"name": "push"},
            "system": "mine",
            "seed": 0,
            "resume": True,
            "progress_bar": False,
            **folders,
        },
        total=4 * 32,
        trials=True,
    )
    chain = rl.ChainTraining(
        skills=skills,
        experts=[expert] * 4,
        run=run,
        settings=rl.ChainSettings(
            rounds=1,
            seed_episodes=0,
            kept_states="all",
            d_omega_of="next",
            carry_over=True,
            order="forward",
            path_steps=0,
            logged_skill=2,
            logged_states=0,
        ),
        rollouts=1,
        training=rl.TrainingSettings(
            rl.PPOSettings(epochs=1), rl.Exploration((0.3, 0.1), (0.2, 0.1)), False, 0.1
        ),
        workshop=workshop,
        gate=rl.Gate(
            rl.GateSettings(True, 0.0, 1),
            lambda known, first: rl.run_trial(skills, workshop.trial(), 0, known, first),
        ),
    )
    reward = rl.weighted(rl.RewardMixture({"env": 1.0}), {})
    trained, chained = [], []
    for turn in chain_turns(chain):
        update = turn.policy_update()
        for rollout in turn.rollouts():
            assert rollout["action"].shape == (8, 4, 3)
            turn.skill.termination_set.extend_from(rollout)
            chained.append(turn.index > 0 and bool(rollout["start_chained"].any()))
            turn.log(rollout, update(reward(rollout), turn.progress))
        trained.append(turn.index)
    assert trained == [0, 1, 2, 3] and any(chained)
    deviations = skills[0].policy(rl.with_starts(Pushing(8, 0, 0)).reset())["scale"][0]
    torch.testing.assert_close(deviations, torch.tensor([0.1, 0.1, 0.1]))
    last = tmp_path / "runs/push/mine/seed0/last/skill0"
    assert checkpoint.is_checkpoint(last)
    again = rl.Skill.load(last)
    assert again.actions == ACTIONS and again.obs_dim == OBSERVED
    for name, values in skills[0].policy.state_dict().items():
        assert torch.equal(values, again.policy.state_dict()[name])


def test_a_training_whose_run_has_no_end_is_refused(tmp_path):
    """It would train nothing, and save the skill as if it had."""
    skill = rl.Skill(
        "push", 0, rl.NetworkSettings(hidden=(8,)), capacity=8, obs_dim=OBSERVED, actions=ACTIONS
    )
    with pytest.raises(rl.InvalidValueError, match=r"give Run\(\.\.\., total=<steps>\)"):
        rl.SkillTraining(
            skill=skill, expert=None, run=a_run(tmp_path), settings=None, collection=None, seed=0,
            warm_start=None, checkpoint_every=1, save=print,
        )  # fmt: skip
