"""How a turn ends: what a recipe must have done by then, and what is not carried over."""

from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.training import Training
from tstar_rl.chaining.turns import Turn
from tstar_rl.rollouts.ray_collection import RayCollection


def test_a_recipe_that_leaves_a_turn_before_its_end_is_told(point_chain, monkeypatch):
    """Its last rollouts would be missing from the log, and the gate would keep it without a trial."""
    rollouts = Turn.rollouts

    def left(turn):
        yield next(rollouts(turn))

    monkeypatch.setattr(Turn, "rollouts", left)
    with pytest.raises(RuntimeError, match="turn 0, of skill 0, was left before its end"):
        point_chain("policy_sequencing", "chain.steps_per_turn=512")


def test_a_rollout_that_was_not_logged_is_told(point_chain, monkeypatch):
    """The row of the one before would stand in its line."""
    logged, log = [], Training.log

    def once(training, rollout, row):
        if not logged:
            log(training, rollout, row)
        logged.append(row)

    monkeypatch.setattr(Training, "log", once)
    with pytest.raises(RuntimeError, match="the last one was not"):
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2")
    assert len(logged) == 2


def test_workers_of_a_cluster_are_never_carried_over():
    skills = [SimpleNamespace(), SimpleNamespace()]
    settings = SimpleNamespace(order="forward", carry_over=True)
    chain = ChainTraining(skills, skills, None, settings, 1, None, None, None)
    workers = Mock(spec=RayCollection)
    chain.kept_by(0).update(collection=workers, update_policy="kept")
    chain.end_turn(0)
    workers.close.assert_called_once()
    assert chain.kept_by(0) == {"update_policy": "kept"}
