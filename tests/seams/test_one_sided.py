"""q and -q are one turn: where quaternions are set on one side, no heap is split."""

import numpy as np
import torch

from tstar_envs import geometry
from tstar_rl.env.layout import PARTS, observation_size
from tstar_rl.seams.one_sided import one_sided
from tstar_rl.seams.what_decides import one_sided_states

POSE = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def test_a_quaternion_and_its_negative_are_one_turn_on_the_side_of_the_first():
    for sign in (1.0, -1.0):
        first = np.array(POSE) * sign
        found = one_sided(np.array([first, -first, first, first]))
        assert found[:, 3].tolist() == [sign] * 4


def test_a_heap_is_not_split_by_a_first_state_that_is_turned_half_round():
    """200 yaws of 180 degrees, give or take 3, with random signs, behind one of 0."""
    rng = np.random.default_rng(0)
    half = np.deg2rad(180 + 3 * rng.standard_normal(200)) / 2
    poses = np.zeros((201, 7))
    poses[0, 3] = 1.0
    poses[1:, 3], poses[1:, 6] = np.cos(half), np.sin(half)
    poses[1:, 3:] *= rng.choice([-1.0, 1.0], 200)[:, None]
    side = one_sided(poses)[1:, 6]
    assert (side > 0.9).all() or (side < -0.9).all()


def test_states_keep_all_else_and_no_state_is_none():
    states = torch.rand(5, observation_size(2))
    states[2, PARTS + 3 : PARTS + 7] *= -1
    found = one_sided_states(states)
    assert torch.equal(found[:, :PARTS], states[:, :PARTS]) and torch.equal(found[:, -8:], states[:, -8:])
    assert bool((found[:, PARTS + 3 : PARTS + 7] >= 0).all())
    assert one_sided_states(states[:0]).shape == states[:0].shape


def test_it_is_what_the_world_does():
    """Two pieces of code, since those who read results load no torch."""
    generator = torch.Generator().manual_seed(0)
    for spread in (0.1, 1.0):
        turns = torch.nn.functional.normalize(
            torch.tensor([0.3, -0.5, 0.7, 0.2]) + spread * torch.randn(40, 4, generator=generator), dim=-1
        ).double()
        turns[::3] *= -1
        poses = torch.cat([torch.zeros(40, 3), turns], dim=-1)
        np.testing.assert_array_equal(one_sided(poses.numpy())[:, 3:], geometry.one_sided(turns).numpy())
