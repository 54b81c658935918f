"""What a turn learns from and what it keeps, on a chain that trains in seconds."""

from copy import deepcopy
from types import SimpleNamespace

import pytest
import torch

from tstar_rl.chaining import turns
from tstar_rl.chaining.gate import Gate
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.trials import run_trial
from tstar_rl.chaining.turns import Turn
from tstar_rl.config import chain
from tstar_rl.updates import DiscriminatorUpdate

SHORT = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100")
"""Turns of one rollout, and no trial."""


@pytest.mark.parametrize("seed_episodes", [0, 32])
def test_the_sets_begin_with_what_a_trial_of_the_chain_has_seen_or_empty(
    seed_episodes, point_chain, monkeypatch
):
    sizes = []
    rollouts = Turn.rollouts

    def watched(turn):
        if turn.run.turn == 0:
            sizes.extend((len(s.initiation_set), len(s.termination_set)) for s in turn.chain.skills)
        yield from rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    point_chain("tstar", *SHORT, f"chain.seed_episodes={seed_episodes}")
    if not seed_episodes:
        assert sizes == [(0, 0)] * 4
    else:
        assert sizes[0] == (32, 32) and sizes[1] == sizes[2] == sizes[3] and 0 < sizes[1][0] < 32


def test_the_first_turn_counts_the_steps_of_the_episodes_before_it_also_after_a_kill(
    point_chain, monkeypatch
):
    """Killed in the first turn, so that the episodes are run again."""
    seeding, judged = [], []
    judge = Gate.judge

    def noted(*trial):
        seeding.append(run_trial(*trial))
        return seeding[-1]

    def watched(*gate, **calls):
        judged.append(judge(*gate, **calls))
        return judged[-1]

    def killed(turn, rollout):
        raise KeyboardInterrupt

    monkeypatch.setattr(turns, "run_trial", noted)
    monkeypatch.setattr(Gate, "judge", watched)
    values = ("chain.gate=true", "chain.steps_per_turn=512", "chain.links=2")
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Turn, "_finish_rollout", killed)
        point_chain("tstar", *values, resumable=True)
    table = point_chain("tstar", *values, resumable=True)
    again, expected = seeding[-1].steps(), [judgement.steps for judgement in judged]
    assert len(seeding) == 2 and seeding[0].steps() == again > 0
    assert table.trial_steps.tolist() == [expected[0] + again, expected[1]]


def test_the_policy_is_updated_after_a_rollout_of_the_chains_own_horizon(point_chain, monkeypatch):
    shapes = []
    log = Turn.log

    def note(turn, rollout, row):
        shapes.append(tuple(rollout.shape))
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    table = point_chain("tstar", *SHORT, "chain.links=2", "chain.horizon=2")  # training.horizon is 8
    assert shapes == [(64, 2)] * 8  # two turns of 512 steps
    assert table.env_steps.tolist() == [128 * k for k in range(1, 9)]


@pytest.mark.parametrize("carry_over", [True, False])
def test_optimisers_and_simulations_are_carried_over_or_made_anew(carry_over, point_chain, monkeypatch):
    seen = {}
    rollouts = Turn.rollouts

    def watched(turn):
        ids = seen.setdefault(turn.index, [])
        ids.append((id(turn.collection), turn.kept["update_policy"].updates))
        seen.setdefault("objects", []).append(turn.collection)  # so that no id is used twice
        yield from rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    values = ("chain.links=2", "chain.rounds=2", f"chain.carry_over={str(carry_over).lower()}")
    point_chain("tstar", *SHORT, *values)
    for index in range(2):
        (first, none), (second, updates) = seen[index]
        assert (first == second) is carry_over and none == 0 and updates == (1 if carry_over else 0)


@pytest.mark.parametrize("d_omega_of", ["next", "own"])
def test_whose_d_omega_a_turn_trains(d_omega_of, point_chain, monkeypatch):
    changed, rollouts = {}, Turn.rollouts

    def watched(turn):
        before = [deepcopy(skill.d_omega.network.state_dict()) for skill in turn.chain.skills]
        yield from rollouts(turn)
        now = [skill.d_omega.network.state_dict() for skill in turn.chain.skills]
        pairs = enumerate(zip(before, now, strict=True))
        changed[turn.index] = [i for i, (a, b) in pairs if any(not torch.equal(a[k], b[k]) for k in a)]

    monkeypatch.setattr(Turn, "rollouts", watched)
    point_chain("tstar", *SHORT, "chain.links=3", "chain.rounds=2", f"chain.d_omega_of={d_omega_of}")
    assert changed == ({0: [1], 1: [2], 2: []} if d_omega_of == "next" else {0: [], 1: [1], 2: [2]})


@pytest.mark.parametrize("kept_states", ["all", "chained"])
def test_which_terminal_states_are_kept(kept_states, point_chain, monkeypatch):
    """As many as succeed, or as succeed in episodes that began in a chained start; of starts always all."""
    counted = {}
    log = Turn.log

    def note(turn, rollout, row):
        won = rollout["next", "success"].squeeze(-1)
        chained = rollout["start_chained"].squeeze(-1) if turn.index else torch.ones_like(won)
        here = counted.setdefault(turn.index, [0, 0])
        here[0] += int((won & chained).sum())
        here[1] += int(won.sum())
        counted[turn.index, "added"] = len(turn.skill.termination_set)
        counted[turn.index, "begun"] = len(turn.skill.initiation_set)
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    values = ("chain.links=2", "chain.seed_episodes=0", f"chain.kept_states={kept_states}")
    point_chain("tstar", "chain.gate=false", *values)
    for index in range(2):
        chained, won = counted[index]
        assert counted[index, "added"] == (won if kept_states == "all" else chained)
        assert counted[index, "begun"] == won
        assert chained == won if index == 0 else 0 < chained < won


def test_where_no_start_is_chained_no_terminal_state_is_kept(point_chain, monkeypatch):
    added = {}
    log = Turn.log

    def note(turn, rollout, row):
        added[turn.index] = len(turn.skill.termination_set)
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    starts = "chain.starts={environment: 1.0, gaussian: 0.0, buffer: 0.0}"
    values = ("chain.links=2", "chain.seed_episodes=0", "chain.kept_states=chained", starts)
    point_chain("policy_sequencing", "chain.gate=false", *values)
    assert added[0] > 0 and added[1] == 0


def test_a_chain_begins_with_the_checkpoint_that_is_asked_for(point_chain, tmp_path, monkeypatch):
    for index in range(2):
        place = tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{index}"
        skill = Skill.load(place / "last")
        skill.policy[0][1].module[0][-1].bias.data[8] = 0.5  # the point has no such action
        skill.save(place / "best")
    begun, rollouts = [], Turn.rollouts

    def watched(turn):
        begun.append(float(turn.skill.policy[0][1].module[0][-1].bias.data[8]))
        yield from rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    point_chain("tstar", *SHORT, "chain.links=2", "from_checkpoint=best")
    assert begun == [0.5, 0.5]


def test_a_turn_explores_as_the_schedule_ends(point_chain, monkeypatch):
    used, log = set(), Turn.log

    def note(turn, rollout, row):
        used.update(rollout["scale"][..., 0].flatten().tolist())
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    point_chain("tstar", *SHORT, "chain.links=2", "exploration={arm: [0.5, 0.25], hand: [0.3, 0.3]}")
    assert used == {0.25}


def test_f_phi_learns_from_the_demonstrations_of_its_own_subtask(point_chain, monkeypatch):
    def demonstrations(config, subtask):
        observations = torch.full((64, 72), float(subtask))
        return SimpleNamespace(observations=observations, actions=torch.zeros(64, 9))

    monkeypatch.setattr(chain, "load_demonstrations", demonstrations)
    seen, update = [], DiscriminatorUpdate.__call__

    def noted(this, **kinds):
        if "expert" in kinds:
            seen.append(float(kinds["expert"].mean()))
        return update(this, **kinds)

    monkeypatch.setattr(DiscriminatorUpdate, "__call__", noted)
    point_chain("tstar", *SHORT, "chain.links=3")
    assert seen == [0.0, 1.0, 2.0]
