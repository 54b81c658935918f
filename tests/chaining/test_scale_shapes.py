"""Scales for a GPU at their own shapes, on few simulations of a point that takes as long as the furniture does."""

import pytest
import yaml
from point_chain import PointChain

from tstar_rl.chaining.turns import Turn
from tstar_rl.config.values import CONFIGS

SIMULATIONS = 8
UPDATES = (
    "++ppo.epochs=1",
    "++chain.ppo.epochs=1",
    "++ppo.entropy_coeff=0",
    "++f_phi.steps=1",
    "d_omega.steps=1",
)
"""As short as they can be: what a policy learns is not looked at."""


def shape(scale: str) -> tuple[int, int]:
    """Steps of a rollout, and rollouts of a turn, at a scale."""
    values = yaml.safe_load((CONFIGS / f"scale/{scale}.yaml").read_text())
    training = values["training"]
    frames = training["num_envs"] * training["horizon"]
    return training["horizon"], values["chain"]["steps_per_turn"] // frames


@pytest.mark.parametrize("scale", ["gpu", "paper_gpu"])
@pytest.mark.parametrize("carry_over", [True, False])
def test_successes_reach_the_sets(scale, carry_over, point_chain, monkeypatch):
    """An episode is longer than a rollout. It ends within what a skill collects over its turns, as these go on."""
    monkeypatch.setattr(PointChain, "pace", 0.05)
    horizon, rollouts = shape(scale)
    rounds = 3 if carry_over and rollouts == 1 else 1  # otherwise a skill's first turn shows all
    added, lengths = {}, []
    log = Turn.log

    def note(turn, rollout, row):
        assert rollout.shape == (SIMULATIONS, horizon)
        lengths.extend(rollout["next", "step_count"][rollout["next", "success"]].tolist())
        added[turn.index] = len(turn.skill.termination_set), len(turn.skill.initiation_set)
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    point_chain(
        "tstar",
        f"scale={scale}",
        "device=cpu",
        "chain.capacity=4096",  # that of the point's skills
        "chain.d_omega_of=next",  # where each has its own, one round is refused
        f"training.num_envs={SIMULATIONS}",
        f"training.horizon={horizon}",
        f"chain.steps_per_turn={SIMULATIONS * horizon * rollouts}",
        "training.max_steps=150",
        f"chain.rounds={rounds}",
        *UPDATES,
        "chain.links=2",
        "chain.seed_episodes=0",
        "chain.gate=false",
        "chain.trial_every=100",
        f"chain.carry_over={str(carry_over).lower()}",
    )
    if carry_over or scale == "gpu":
        assert min(lengths) > horizon, "the stand-in is too fast to show anything"
        assert all(ends > 0 and starts > 0 for ends, starts in added.values())
    else:  # a turn of one rollout from a fresh reset: no episode can end in it
        assert not lengths and set(added.values()) == {(0, 0)}
