"""The wiring of the chaining recipes, on a chain that trains in seconds."""

import json
import time

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.chaining.chain import load_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.trials import run_trial
from tstar_rl.chaining.turns import Turn
from tstar_rl.checks import InvalidValueError
from tstar_rl.env.task_tables import furniture_digest
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import read_config, write_config

NUM_SKILLS = 4
SHORT = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100")
"""Turns of one rollout, and no trial."""


def place(y: float, x: float) -> torch.Tensor:
    observation = torch.zeros(1, 72)
    observation[0, 0], observation[0, 1] = x, y
    return observation


def test_d_omega_says_from_where_the_next_skill_succeeds(point_chain, tmp_path):
    """Skill 1 succeeds from y > 0 only, so that its initiation set lies there and skill 0 ends on both sides."""
    point_chain("tstar", "chain.gate=false", "chain.links=2", "chain.steps_per_turn=4096")
    skills = load_chain(tmp_path / "runs/table_lack/tstar/seed0/last")
    above, below = (float(skills[1].d_omega(place(y, 1.2)).detach()) for y in (0.5, -0.5))
    assert above > below + 0.15, (above, below)


def test_a_success_is_paid_what_the_next_skill_says_of_the_state_that_was_reached(point_chain, monkeypatch):
    paid = []
    log = Turn.log

    def check(turn, rollout, row):
        following = rollout["next"]
        won = following["success"].squeeze(-1)
        if turn.following is None:
            assert "reward_tsr" not in following.keys()
        else:
            said = turn.following.d_omega(following["observation"]).clamp(0, 1) * following["success"]
            torch.testing.assert_close(following["reward_tsr"], said)
            paid.append((turn.index, float(following["reward_tsr"][won].mean())))
        expected = 0.05 * (0.5 * following["reward_env"] + 0.5 * following["reward_gail"])
        if turn.following is not None:
            expected = expected + 0.05 * 10_000 * following["reward_tsr"]
        torch.testing.assert_close(following["reward"], expected)
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", check)
    table = point_chain("tstar", *SHORT)
    assert {index for index, _ in paid} == set(range(NUM_SKILLS - 1))  # the last skill has no next
    assert all(mean > 0 for _, mean in paid)
    assert table[table.skill == NUM_SKILLS - 1].d_omega_initiation_score.isna().all()


def test_what_is_scored_is_what_terminal_reward_says(point_chain, monkeypatch):
    """The state before the last action, in the place of the one that was reached."""
    seen = []
    log = Turn.log

    def check(turn, rollout, row):
        if turn.following is not None:
            said = turn.following.d_omega(rollout["observation"]).clamp(0, 1) * rollout["next", "success"]
            torch.testing.assert_close(rollout["next", "reward_tsr"], said)
            seen.append(float(said.detach().sum()))
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", check)
    point_chain("tstar", *SHORT, "chain.links=2", "terminal_reward.score=before")
    assert seen and all(seen)


def test_a_constant_bonus_is_paid_to_every_success_but_the_last_skills(point_chain):
    table = point_chain("policy_sequencing", *SHORT, "bonus=0.4")
    first, last = (table[(table.skill == NUM_SKILLS - 1) == is_last] for is_last in (False, True))
    assert first.tsr_on_success.tolist() == pytest.approx([0.4] * len(first)) and len(first)
    assert "tsr_on_success" not in last.dropna(axis=1) and (last.success_rate > 0).all()


def test_t_star_makes_the_first_skill_end_where_the_second_can_start(point_chain, tmp_path):
    """Skill 0 succeeds at any y. Paid by d_omega it moves to y > 0 first; without it nothing tells it to."""
    moved = {}
    for recipe in ("tstar", "policy_sequencing"):
        point_chain(
            recipe, "chain.gate=false", "chain.links=2", "chain.rounds=2", "chain.steps_per_turn=4096"
        )
        skill = load_chain(tmp_path / f"runs/table_lack/{recipe}/seed0/last")[0]
        states = torch.cat([place(y, 0.5) for y in torch.linspace(-1, 1, 21).tolist()])
        with torch.no_grad():
            loc = skill.policy.get_dist(TensorDict({"observation": states}, [21])).mean
        moved[recipe] = float(loc[:, 1].mean())
    assert moved["tstar"] > moved["policy_sequencing"] + 0.1, moved


@pytest.mark.parametrize("recipe", ["tstar", pytest.param("policy_sequencing", marks=pytest.mark.slow)])
def test_episodes_begin_where_the_skill_before_ended(recipe, point_chain, monkeypatch):
    """Of skill i a share begins past i + 0.2, where its own starts do not, and none where another skill ends."""
    seen = {}
    log = Turn.log

    def note(turn, rollout, row):
        start = rollout["start_observation"][..., 0] - turn.index
        seen.setdefault(turn.index, []).append(start.flatten())
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    table = point_chain(recipe, *SHORT)
    drawn = table[table.skill > 0][["starts_chained", "starts_environment"]]
    assert (drawn.starts_chained / drawn.sum(axis=1)).between(0.7, 0.9).all()  # .8 of them are asked for
    for index in range(NUM_SKILLS):
        starts = torch.cat(seen[index])
        assert starts.min() > -0.6 and starts.max() < 1.0
        chained = float((starts > 0.2).float().mean())
        assert chained == 0 if index == 0 else 0.2 < chained < 0.9, (index, chained)


def test_a_floor_that_the_skills_were_not_fitted_with_is_refused(point_chain, tmp_path):
    place = tmp_path / "runs/table_lack/gail_ppo/seed0/subtask1/last"
    skill = Skill.load(place)
    assert skill.normalizer.floor_found() is None  # every input varied by more
    skill.normalizer.fit(torch.linspace(-1, 1, 100).unsqueeze(-1) * torch.linspace(0, 1, 72), 0.05)
    assert skill.normalizer.floor_found() == pytest.approx(0.05)
    skill.save(place)
    with pytest.raises(
        CheckpointMismatchError, match="skill 1 of gail_ppo: normalizer.floor was 0.05 .* is 0.02 now"
    ):
        point_chain("tstar", "scale=laptop")
    point_chain("tstar", "scale=laptop", "normalizer.floor=0.05", "chain.rounds=1")


@pytest.mark.parametrize("recipe", ["tstar", "floored", "refitted", "recover"])
def test_skills_of_another_size_or_world_are_refused(point_chain, tmp_path, recipe):
    """They say what they are themselves; the world that they were trained in is in the config of their results."""
    with pytest.raises(
        CheckpointMismatchError, match="skill 0 of gail_ppo: chain.capacity was 4096 .* is 7 now"
    ):
        point_chain(recipe, "scale=laptop", "chain.capacity=7")
    results = tmp_path / "results/table_lack/gail_ppo/seed0/subtask1"
    write_config(results, {"env": {"reset_robot": False, "velocity_scale": 0.4, "gripper": "sign"}})
    told = "was trained in another world: env.preassembled was 'ideal' .* 'jitter' now; env.reset_robot was False"
    with pytest.raises(CheckpointMismatchError, match=f"gail_ppo/seed0/subtask1/last {told}"):
        point_chain(recipe, "scale=laptop")
    if recipe == "floored":
        point_chain(
            recipe, "scale=laptop", "floor=0.7", "demonstrations.may_differ=[preassembled,reset_robot]"
        )


@pytest.mark.parametrize("recipe", ["tstar", "floored", "refitted", "recover"])
def test_a_chain_notes_what_its_skills_took_and_where_it_was_trained(point_chain, tmp_path, recipe):
    for index in range(NUM_SKILLS):
        ended = tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{index}/finished.json"
        ended.write_text(json.dumps({"env_steps": 10, "minutes": 0.5}))
    own = {"floored": ["floor=0.7"], "recover": ["feasibility.steps=2"]}.get(recipe, [])
    point_chain(recipe, "scale=laptop", *SHORT, "chain.rounds=1", *own)
    config = read_config(tmp_path / f"results/table_lack/{recipe}/seed0")
    assert config["skills_took"] == {"env_steps": 10 * NUM_SKILLS, "minutes": 0.5 * NUM_SKILLS}
    saved = checkpoint.read_record(tmp_path / f"runs/table_lack/{recipe}/seed0/last/skill0")
    assert saved["env"] == {name: config["env"][name] for name in saved["env"]} and len(saved["env"]) > 2
    assert saved["furniture"] == furniture_digest("table_lack")
    assert saved["recipe"] == config["recipe"] == recipe


def test_a_chain_is_refitted_to_its_own_states(point_chain, tmp_path, monkeypatch):
    """Skill 3 was fitted around x = 3.5; in the chain it begins at y > 0 alone, and the other inputs never vary."""

    def slow(*given):
        time.sleep(0.2)
        return run_trial(*given)

    monkeypatch.setattr("tstar_rl.run_trial", slow)
    table = point_chain("refitted", "scale=laptop", "chain.trial_episodes=16")
    assert table.skill.tolist() == list(range(NUM_SKILLS)) and (table.env_steps > 0).all()
    took = json.loads((tmp_path / "runs/table_lack/refitted/seed0/finished.json").read_text())
    assert took["minutes"] > 0.2 / 60, "the chain's trial is what refitting costs"
    for index, skill in enumerate(load_chain(tmp_path / "runs/table_lack/refitted/seed0/last")):
        first = Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{index}/last")
        wider = skill.normalizer.scale > first.normalizer.scale
        assert int(wider.sum()) == table.widened_inputs[index]
        assert torch.equal(skill.normalizer.loc, first.normalizer.loc)
        for name, value in first.policy.named_parameters():
            assert torch.equal(value, dict(skill.policy.named_parameters())[name])


def test_a_chain_that_refitting_does_not_change_is_refused_and_the_one_before_stays(
    point_chain, tmp_path, monkeypatch
):
    point_chain("refitted", "scale=laptop", "chain.trial_episodes=16")
    monkeypatch.setattr(Normalizer, "widen", lambda normalizer, obs: 0)
    with pytest.raises(InvalidValueError, match="no input varies more in the chain than it did in training"):
        point_chain("refitted", "scale=laptop", "chain.trial_episodes=16", "resume=false")
    run = tmp_path / "runs/table_lack/refitted/seed0"
    assert (run / "finished.json").is_file() and len(load_chain(run / "last")) == NUM_SKILLS


def test_a_floor_raised_after_the_fact_changes_the_inputs_alone(point_chain, tmp_path):
    table = point_chain("floored", "scale=laptop", "floor=0.7")
    assert (table.raised_inputs > 0).all() and table.skill.tolist() == list(range(NUM_SKILLS))
    for index, skill in enumerate(load_chain(tmp_path / "runs/table_lack/floored/seed0/last")):
        first = Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{index}/last")
        assert bool((skill.normalizer.scale >= 0.7 - 1e-6).all()) and bool(
            (first.normalizer.scale < 0.7).any()
        )
        for name, value in first.policy.named_parameters():
            assert torch.equal(value, dict(skill.policy.named_parameters())[name])


def test_a_floor_below_all_inputs_is_refused_and_leaves_nothing(point_chain, tmp_path):
    with pytest.raises(
        InvalidValueError, match="no input stands below floor=0.5: .*; give a higher floor=..."
    ):
        point_chain("floored", "scale=laptop", "floor=0.5")
    assert not any((tmp_path / place / "table_lack/floored").exists() for place in ("runs", "results"))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("networks.hidden=[32]", r"skill 0 of gail_ppo: networks.hidden was \[16\] .* and is \[32\] now"),
        ("chain.capacity=100", "skill 0 of gail_ppo: chain.capacity was 4096 .* and is 100 now"),
    ],
)
def test_networks_and_sets_that_the_skills_do_not_have_are_refused(value, said, point_chain):
    """A chain keeps what its skills have, so a value that says otherwise would be a lie in config.yaml."""
    with pytest.raises(CheckpointMismatchError, match=said):
        point_chain("tstar", value)
