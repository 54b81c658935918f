"""The training of one policy, on the point: its normaliser, and how it goes on after a kill."""

import pandas as pd
import pytest
import torch

from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.skill_training import SkillTraining
from tstar_rl.chaining.training import Training
from tstar_rl.checks import InvalidValueError
from tstar_rl.runs import checkpoint
from tstar_rl.updates import PolicyUpdate

VALUES = ("training.total_steps=4096", "training.checkpoint_every=1024", "training.max_steps=3")
WARM_UPS = ("ppo.critic_warmup=3", "++ppo.rate_warmup=100")


def test_a_killed_training_goes_on_to_the_same_figures(point_chain, monkeypatch, tmp_path):
    """It does not clone again; updates, warm-ups and simulations come back; what it does not read may differ."""
    whole = point_chain("gail_ppo", *VALUES, *WARM_UPS, "system=whole")
    finish = Training._finish_rollout

    def killed(training, rollout):
        if training.steps > 2048:
            raise KeyboardInterrupt
        return finish(training, rollout)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Training, "_finish_rollout", killed)
        point_chain("gail_ppo", *VALUES, *WARM_UPS, "system=cut", resumable=True)
    rest = []
    with monkeypatch.context() as patch:
        patch.setattr(Training, "_finish_rollout", lambda *both: rest.append(both) or finish(*both))
        cut = point_chain("gail_ppo", *VALUES, *WARM_UPS, "system=cut", "chain.rounds=2", resumable=True)
    assert len(rest) == 4  # of eight: it does not begin anew
    pd.testing.assert_frame_equal(cut, whole)
    for name in ("last", "best"):
        folders = (tmp_path / f"runs/table_lack/{system}/seed0/{name}" for system in ("whole", "cut"))
        one, other = (Skill.load(folder).network_state() for folder in folders)
        torch.testing.assert_close(one, other, rtol=0, atol=0)


def test_the_best_skill_is_kept(point_chain, monkeypatch, tmp_path):
    finish, completed = Training._finish_rollout, iter((0.0, 1.0, 0.0, 0.0))
    monkeypatch.setattr(
        Training, "_finish_rollout", lambda *both: {**finish(*both), "completed": next(completed)}
    )
    table = point_chain("gail_ppo", "training.total_steps=2048", "system=mine")
    run = tmp_path / "runs/table_lack/mine/seed0"
    steps = {name: checkpoint.read_record(run / name)["env_steps"] for name in ("best", "last")}
    assert table.completed.tolist() == [0, 1, 0, 0] and steps == {"best": 1024, "last": 2048}


@pytest.mark.parametrize("recipe", ["ppo", "gail"])
def test_one_reward_alone_trains_a_policy(recipe, point_chain):
    table = point_chain(recipe, "training.total_steps=1024", "ppo.critic_warmup=0", "system=alone")
    assert len(table) == 2 and (table.actor_steps > 0).any() and table.loss_policy.notna().all()
    paid = table.reward_env if recipe == "ppo" else table.reward_gail
    assert table.reward.to_numpy() == pytest.approx(0.05 * paid.to_numpy(), rel=1e-4)
    if recipe == "gail":
        assert (table.reward_gail > 0).all()
        assert (table.f_phi_expert_score > table.f_phi_agent_score).all(), "the expert is the first label's"


def rates_of(monkeypatch) -> list[float]:
    """The actor's rate in every update."""
    rates, update = [], PolicyUpdate.__call__

    def noted(policy_update, *values):
        log = update(policy_update, *values)
        rates.append(policy_update.actor_optimizer.param_groups[0]["lr"])
        return log

    monkeypatch.setattr(PolicyUpdate, "__call__", noted)
    return rates


@pytest.mark.parametrize(
    ("recipe", "values", "updates"),
    [
        ("gail_ppo", ["training.total_steps=2048"], 4),
        ("tstar", ["chain.links=2", "chain.rounds=2", "chain.steps_per_turn=512", "chain.gate=false"], 4),
    ],
)
def test_rates_fall_evenly_over_the_whole_run(recipe, values, updates, point_chain, monkeypatch):
    """Of a chain that is all rounds of all skills, of which each has an optimiser of its own."""
    rates = rates_of(monkeypatch)
    point_chain(recipe, *values, "ppo.linear_decay=true", "ppo.critic_warmup=0", "system=mine")
    assert rates == pytest.approx([1e-3 * (1 - step / updates) for step in range(1, updates + 1)])


@pytest.mark.parametrize("running", ["false", "true"])
def test_a_skill_is_fitted_with_the_floor_that_is_asked_for(running, point_chain, tmp_path):
    """Inputs of the demonstrations vary by .3: they stand below .5."""
    values = ("training.total_steps=512", "normalizer.floor=0.5", f"normalizer.running={running}")
    point_chain("gail_ppo", *values, "warm_start=false", "system=whole")
    skill = Skill.load(tmp_path / "runs/table_lack/whole/seed0/last")
    assert skill.normalizer.floor_found() == pytest.approx(0.5)
    assert skill.normalizer.count == 64 + (512 if running == "true" else 0)


def test_a_clone_is_fitted_with_the_floor_that_is_asked_for(point_chain, tmp_path):
    point_chain("bc", "bc.epochs=1", "normalizer.floor=0.5")
    skill = Skill.load(tmp_path / "runs/table_lack/bc/seed0/last")
    assert skill.normalizer.floor_found() == pytest.approx(0.5)


@pytest.mark.parametrize(("rollouts", "told"), [(2, True), (3, False)])
def test_a_policy_that_was_not_trained_is_told(rollouts, told, point_chain, capsys):
    values = (f"training.total_steps={512 * rollouts}", "ppo.critic_warmup=2", f"system=of_{rollouts}")
    table = point_chain("gail_ppo", *values)
    assert (table.actor_steps.max() == 0) == told and len(table) == rollouts
    said = "PPO took no step of the policy: the critic alone learns in the first 2 rollouts"
    assert (said in capsys.readouterr().out) == told


def test_an_update_is_made_once(point_chain, monkeypatch):
    """A run that is resumed would load the second one's state into the first."""
    make = SkillTraining.policy_update
    monkeypatch.setattr(SkillTraining, "policy_update", lambda training: [make(training), make(training)][1])
    with pytest.raises(InvalidValueError, match="has an update_policy already"):
        point_chain("gail_ppo", "training.total_steps=512", "system=twice")


def test_exploration_falls_evenly_from_rollout_to_rollout(point_chain, monkeypatch):
    used, log = [], SkillTraining.log

    def note(training, rollout, row):
        used.extend(rollout["scale"][..., 0].unique().tolist())
        log(training, rollout, row)

    monkeypatch.setattr(SkillTraining, "log", note)
    values = ("training.total_steps=2048", "exploration={arm: [0.4, 0.2], hand: [0.3, 0.3]}")
    point_chain("gail_ppo", *values, "system=falling")
    assert used == pytest.approx([0.4, 0.35, 0.3, 0.25])
