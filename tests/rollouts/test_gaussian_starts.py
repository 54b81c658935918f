"""Policy Sequencing's starts in the real environment."""

import torch
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl import FurnitureEnv
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.rollouts.terminal_gaussian import TerminalGaussian

PARTS = slice(29, 64)


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


def test_positions_written_back_change_nothing():
    env = FurnitureEnv("table_lack", 4, 2, nthread=1, seed=0, snapshots=True, preassembled="jitter")
    snapshot = env.reset()["snapshot"]
    qpos = env.qpos_of(snapshot)
    same, possible = env.with_qpos(snapshot, qpos)
    assert possible.all()
    assert torch.allclose(env.qpos_of(same), qpos, atol=1e-12)
