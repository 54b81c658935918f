"""The signals beyond the paper's, wired into the turns of a chain that trains in seconds.

Skill 0 succeeds at any y; skill 1 from y > 0 only, and no skill's own reward minds y.
"""

import pandas as pd
import pytest
import torch
from tensordict import TensorDict

from tstar_rl.chaining.chain import load_chain
from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.turns import Turn

UNIT = "value_scale=1"
"""The mean of an untrained critic is no unit."""
TWO = ("chain.gate=false", "chain.links=2")
SHORT = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100")
"""Turns of one rollout, and no trial."""
OWN = {
    "feasibility": ("feasibility.learning_rate=3e-3",),
    "hand_over_value": ("chain.order=backward", "ppo.critic_learning_rate=1e-2", "ppo.epochs=4"),
    "proximity": ("chain.path_steps=8", "proximity.learning_rate=3e-3"),
    "scar_like": (),
}
"""What each recipe needs to learn within a few rollouts of three steps an episode."""
ONE_FAST = [
    "feasibility",
    *(pytest.param(name, marks=pytest.mark.slow) for name in OWN if name != "feasibility"),
]
COLUMN = {"scar_like": "d_seams"}


def states(x: float, ys: list[float]) -> torch.Tensor:
    observation = torch.zeros(len(ys), 72)
    observation[:, 0], observation[:, 1] = x, torch.tensor(ys)
    return observation


def sideways(folder) -> float:
    """How far skill 0 steps along y, the mean over where it may stand."""
    skill = load_chain(folder)[0]
    rows = states(0.5, torch.linspace(-1, 1, 21).tolist())
    with torch.no_grad():
        return float(skill.policy.get_dist(TensorDict({"observation": rows}, [21])).mean[:, 1].mean())


def last(tmp_path, system: str):
    return tmp_path / f"runs/table_lack/{system}/seed0/last"


@pytest.mark.parametrize("recipe", ONE_FAST)
def test_a_signal_moves_where_the_first_skill_ends(recipe, point_chain, tmp_path):
    """Paid by the signal, skill 0 steps towards y > 0; what it was before had no part in y."""
    values = (*TWO, "chain.rounds=2", "chain.steps_per_turn=4096", *OWN[recipe])
    table = point_chain(recipe, *values)
    assert sideways(last(tmp_path, recipe)) > 0.1
    judged = table.dropna(subset=["next_success"])
    assert (
        judged[f"{COLUMN.get(recipe, recipe)}_auc"].dropna().iloc[-1] > 0.9
    )  # there is none where all succeed
    assert 0 < judged.next_success.iloc[0] < judged.next_success.iloc[-1]


@pytest.mark.parametrize("label", ["success", pytest.param("share", marks=pytest.mark.slow)])
def test_f_says_from_where_the_next_skill_succeeds(label, point_chain, tmp_path):
    """With a third skill that always succeeds, the share of the rest that is done is 0 or 1 as well."""
    values = (*TWO[:1], "chain.links=3", f"label={label}", *OWN["feasibility"])
    point_chain("feasibility", *values, "feasibility.steps=256")
    f = load_chain(last(tmp_path, "feasibility"))[1].networks["feasibility"]
    with torch.no_grad():
        said = f(states(1.2, [0.5, -0.5])).sigmoid().squeeze(-1)
    assert said[0] > 0.8 and said[1] < 0.2


@pytest.fixture
def errors_known(monkeypatch) -> list[bool]:
    """Whether the next critic's error was known, of each turn of a skill that has one after it."""
    found, learned = [], Turn.learned

    def watched(turn, name, skill):
        network = learned(turn, name, skill)
        found.append(network is not None)
        return network

    monkeypatch.setattr(Turn, "learned", watched)
    return found


def test_a_critics_error_is_learned_in_its_own_turn(point_chain, errors_known):
    """Forward, skill 0's first turn trusts skill 1's critic; its second one knows the error."""
    table = point_chain("hand_over_value", *TWO, UNIT, "chain.rounds=2", "chain.steps_per_turn=512")
    assert table.value_error_loss.notna().all() and (table.value_error_states > 0).all()
    assert errors_known == [False, True]


def test_an_error_that_was_learned_from_no_state_is_not_known(point_chain, errors_known):
    """Only chained starts count, and hardly any is drawn: in skill 1's turn the update is made, and has no data."""
    values = (
        "chain.kept_states=chained",
        "chain.starts={environment: 0.999999999, gaussian: 0.0, buffer: 1e-9}",
    )
    table = point_chain(
        "hand_over_value",
        UNIT,
        *TWO,
        *values,
        "chain.rounds=2",
        "chain.steps_per_turn=512",
        "chain.trial_every=100",
    )
    assert table[table.skill == 1].value_error_loss.isna().all() and errors_known == [False, False]


@pytest.mark.parametrize(("margin", "known"), [(10.0, True), (-10.0, False)])
def test_an_error_that_a_rejected_turn_has_learned_is_not_known(point_chain, errors_known, margin, known):
    """Skill 1's turn comes first. Put back, it leaves a network that has learned nothing."""
    values = ("chain.links=2", "chain.order=backward", "chain.rounds=1", "chain.steps_per_turn=512")
    table = point_chain("hand_over_value", *values, UNIT, "chain.gate=true", f"chain.gate_margin={margin}")
    assert table.accepted.dropna().tolist() == [int(known)] * 2
    assert errors_known == [known]


def test_both_sides_train_the_discriminator_of_a_skill(point_chain, monkeypatch):
    seams = {}
    rollouts = Turn.rollouts

    def watched(turn):
        seams[turn.index] = [(seam.before.subtask, seam.after.subtask) for seam in turn.seams]
        yield from rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    table = point_chain("scar_like", "chain.gate=false", "chain.links=3", "chain.steps_per_turn=512")
    assert seams == {0: [(0, 1)], 1: [(0, 1), (1, 2)], 2: [(1, 2)]}
    assert table.d_seams_loss_discriminator.notna().all()
    assert table[table.skill == 2].reward_tsr.isna().all()  # nothing comes after the last skill


BOTH = [("forward", "tstar"), ("backward", "tstar")]
OTHERS = [("forward", "feasibility"), *(("backward", recipe) for recipe in ("policy_sequencing", *OWN))]


@pytest.mark.parametrize(
    ("order", "recipe"), [*BOTH, *(pytest.param(*other, marks=pytest.mark.slow) for other in OTHERS)]
)
def test_the_order_of_turns(order, recipe, point_chain):
    own = ("chain.path_steps=4",) if recipe == "proximity" else ()
    table = point_chain(recipe, *SHORT, "chain.rounds=2", "chain.links=2", f"chain.order={order}", *own)
    once = [0, 1] if order == "forward" else [1, 0]
    assert table.skill.tolist() == 2 * once and table["round"].tolist() == [0, 0, 1, 1]


def test_what_is_said_of_fresh_states_is_logged_each_turn(point_chain, tmp_path):
    short = ("chain.steps_per_turn=512", "chain.rounds=2")
    table = point_chain("feasibility", "chain.gate=true", "chain.links=3", *short)
    ends = table.dropna(subset=["trial_progress"])
    names = [f"feasibility_{name}" for name in ("auc", "sd", "brier", "ece")]
    first = ends[ends.skill == 0]
    assert len(first) == 2 and first[names].notna().all().all()
    assert ends[ends.skill == 2][names].isna().all().all()  # the last skill hands over to none
    curves = pd.read_csv(tmp_path / "results/table_lack/feasibility/seed0/calibration.csv")
    counted = curves.groupby(["env_steps", "skill"]).states.sum()
    assert counted.tolist() == ends[ends.skill < 2].handed.tolist()
    for (steps, _), bins in curves.groupby(["env_steps", "skill"]):
        row = ends[ends.env_steps == steps].iloc[0]
        share = (bins.outcome * bins.states).sum() / bins.states.sum()
        error = ((bins.score - bins.outcome).abs() * bins.states).sum() / bins.states.sum()
        assert share == pytest.approx(row.next_success) and error == pytest.approx(row.feasibility_ece)


def test_a_rejected_turns_outcomes_are_those_of_the_skills_after(spoiled_turns, point_chain, monkeypatch):
    asked = []
    keep = ChainTraining.keep_outcomes

    def note(chain, trial, rejected=None):
        asked.append(rejected)
        keep(chain, trial, rejected)

    monkeypatch.setattr(ChainTraining, "keep_outcomes", note)
    table = point_chain("feasibility", "chain.gate=true", "chain.links=2")
    assert table.accepted.dropna().tolist() == [0, 0] and asked == [None, 0, 1]


@pytest.mark.parametrize("recipe", ONE_FAST)
def test_a_killed_chain_goes_on_to_the_same_figures(recipe, whole_and_resumed, tmp_path):
    """Sets, networks with inputs of their own scale, and optimisers: all come back from a checkpoint.

    Killed in skill 0's second turn, which the signal of skill 1 pays.
    """
    own = {"proximity": ("chain.path_steps=4",), "feasibility": ("feasibility.floor=1e-4",)}.get(recipe, ())
    values = ("chain.gate=true", "chain.rounds=2", "chain.links=3", *own)
    whole, resumed = whole_and_resumed(recipe, *values)
    pd.testing.assert_frame_equal(resumed, whole)
    for one, other in zip(*(load_chain(last(tmp_path, system)) for system in ("whole", "cut")), strict=True):
        torch.testing.assert_close(one.network_state(), other.network_state(), rtol=0, atol=0)
    if recipe == "feasibility":
        floor = load_chain(last(tmp_path, "whole"))[1].network("feasibility").normalizer.floor
        assert float(floor) == pytest.approx(1e-4)


@pytest.mark.parametrize("recipe", ["feasibility", "hand_over_value", "scar_like"])
def test_a_signal_is_paid_as_its_options_say(recipe, point_chain, monkeypatch):
    own = ("value_scale=1", "alpha=3") if recipe == "hand_over_value" else ()
    given, signal = [], Turn.signal

    def noted(turn, name, one, *label):
        given.append(one)
        return signal(turn, name, one, *label)

    monkeypatch.setattr(Turn, "signal", noted)
    short = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100", "chain.links=2")
    point_chain(recipe, *short, "terminal_reward={score: before, baseline: running_mean}", *own)
    assert {(one.score, one.baseline) for one in given} == {("before", "running_mean")}
    assert recipe != "hand_over_value" or {one.alpha for one in given} == {3.0}


@pytest.mark.parametrize("recipe", ["tstar", "policy_sequencing", *OWN])
def test_f_phi_scores_the_expert_above_the_agent(recipe, point_chain):
    own = ("chain.path_steps=4",) if recipe == "proximity" else ()
    fast = ("f_phi.steps=128", "f_phi.learning_rate=3e-3", "f_phi.gradient_penalty=0.1")
    table = point_chain(recipe, *SHORT, "chain.links=2", *fast, *own)
    assert (table.f_phi_expert_score > table.f_phi_agent_score + 0.2).all()
