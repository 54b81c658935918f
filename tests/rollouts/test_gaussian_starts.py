"""Policy Sequencing's starts in the real environment."""

import mujoco
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl import FurnitureEnv
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.rollouts.terminal_gaussian import TerminalGaussian

PARTS = slice(29, 64)
FINGER = 7
LEG_2_Z = 9 + 7 * 1 + 2  # the leg of the first step


def test_gaussian_starts_look_like_the_states_they_are_fitted_to():
    env = with_starts(FurnitureEnv("table_lack", 16, 0, nthread=1, seed=0, snapshots=True))
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, env.base_env.expert())
    reached = TerminationSet(64)
    assert reached.extend_from(last) >= 12

    following = FurnitureEnv("table_lack", 32, 1, nthread=1, seed=1)
    gaussian = TerminalGaussian(following, reached)
    started = with_starts(following, gaussian, probability=1.0).reset()["observation"]
    seen = reached.all()["observation"]
    # No quaternion is on the other side: that would be the same pose, and another observation.
    for part in range(5):
        quats = started[:, PARTS].view(-1, 5, 7)[:, part, 3:]
        nearest = (quats @ seen[:, PARTS].view(-1, 5, 7)[:, part, 3:].T).amax(-1)
        assert (nearest > 0.98).all(), part
    assert gaussian.counts["drawn"] >= 32 and gaussian.counts["given_up"] == 0


def test_quaternions_of_both_signs_have_one_gaussian():
    env = FurnitureEnv("table_lack", 8, 0, nthread=1, seed=0, snapshots=True)
    snapshot = env.reset()["snapshot"]
    leg = slice(9 + 7 * 3 + 3, 9 + 7 * 4)
    fitted = []
    for turned in (
        [],
        [1, 4, 5, 7],
    ):  # the same rotations of one leg, of these simulations with the other sign
        qpos = env.qpos_of(snapshot)
        qpos[turned, leg] *= -1
        reached, both = TerminationSet(8), snapshot.clone()
        both["physics"][:, env.world._editor._slice(mujoco.mjtState.mjSTATE_QPOS)] = qpos
        reached.extend(TensorDict({"observation": torch.zeros(8, 72), "snapshot": both}, [8]))
        gaussian = TerminalGaussian(env, reached)
        gaussian.fit()
        fitted.append((gaussian.mean, gaussian.factor @ gaussian.factor.T))
    assert torch.equal(fitted[0][0], fitted[1][0]) and torch.allclose(*(spread for _, spread in fitted))
    assert fitted[0][0][leg].norm() > 0.99


def test_positions_written_back_change_nothing():
    env = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=0, snapshots=True, preassembled="jitter")
    snapshot = env.reset()["snapshot"]
    qpos = env.qpos_of(snapshot)
    same, possible = env.with_qpos(snapshot, qpos)
    assert possible.all()
    assert torch.allclose(env.qpos_of(same), qpos, atol=1e-12)


def test_a_state_that_strains_may_be_replaced_by_what_strains_no_more():
    """As where a hand lets go without being put home: its finger presses on the part, beyond the joint's own limit."""
    env = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=0, snapshots=True, preassembled="jitter")
    easy = env.reset()["snapshot"]
    qpos = env.qpos_of(easy)
    pressed, further = qpos.clone(), qpos.clone()
    pressed[:, FINGER] += 0.005
    further[:, FINGER] += 0.010
    strained, possible = env.with_qpos(easy, pressed)
    assert not possible.any(), "no easy state is replaced by one that strains"
    for positions, expected in ((pressed, True), (qpos, True), (further, False)):
        assert (env.with_qpos(strained, positions)[1] == expected).all()


def test_parts_that_were_joined_askew_may_be_moved_as_they_are():
    """Welds give: under a load, connectors part by more than the 2 cm within which they are joined."""
    env = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=0, snapshots=True, preassembled="jitter")
    straight = env.reset()["snapshot"]
    qpos = env.qpos_of(straight)
    askew = qpos.clone()
    askew[:, LEG_2_Z] += 0.03
    apart, possible = env.with_qpos(straight, askew)
    assert not possible.any()
    assert env.with_qpos(apart, askew)[1].all() and env.with_qpos(apart, qpos)[1].all()
    askew[:, LEG_2_Z] += 0.01
    assert not env.with_qpos(apart, askew)[1].any(), "further apart than they were"


def test_no_weld_is_written_that_a_reset_would_refuse():
    """A weld that is torn by more than 10 cm joins nothing: its parts may not be drawn as far apart."""
    env = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=0, snapshots=True, preassembled="jitter")
    torn, everything = env.reset()["snapshot"].clone(), torch.ones(4, dtype=torch.bool)
    far, near = env.qpos_of(torn), env.qpos_of(torn)
    far[:, LEG_2_Z] += 0.15
    near[:, LEG_2_Z] += 0.08
    torn, _ = env.with_qpos(torn, far)
    with pytest.raises(ValueError, match="its welds are those of other furniture"):
        env.world.reset_to(torn, everything)
    assert not env.with_qpos(torn, far)[1].any()
    drawn, possible = env.with_qpos(torn, near)
    assert possible.all()
    env.world.reset_to(drawn, everything)


def test_what_was_drawn_is_counted_on_after_a_resume():
    env = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=0, snapshots=True, preassembled="jitter")
    begun, reached = env.reset(), TerminationSet(4)
    reached.extend(begun.select("observation", "snapshot"))

    def collection() -> Collection:
        base = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=1, preassembled="jitter")
        starts = with_starts(base, TerminalGaussian(base, reached), probability=1.0)
        return Collection(starts, env.expert(), 1)

    first, second = collection(), collection()
    first.env.reset()  # once more than the second
    assert first.counts()["gaussian_drawn"] >= 4 and second.counts() != first.counts()
    second.load_state_dict(first.state_dict())
    assert second.counts() == first.counts()
