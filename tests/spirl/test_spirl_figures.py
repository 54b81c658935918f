"""Latents drawn from a prior, played and drawn."""

import torch
from spirl_agent import make_agent
from torch.testing import assert_close

from tstar_rl import FurnitureEnv
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.spirl.figures import draw_latents, evenly_spread_rows, play_latents


def demonstration(env: FurnitureEnv, steps: int) -> Demonstrations:
    """One simulation that stands still."""
    env.reset()
    rows = [
        (env.world.observation().float()[:1], env.snapshot()[:1], env.world.step(torch.zeros(2, 9)))[:2]
        for _ in range(steps)
    ]
    observations, snapshots = torch.cat([row[0] for row in rows]), torch.cat([row[1] for row in rows])
    actions, one = torch.zeros(steps, 9), torch.ones(1, dtype=torch.int64)
    return Demonstrations(
        "table_lack", 0, "plain", {}, one, steps * one, observations, actions, actions, one.bool(), snapshots
    )


def test_rows_are_of_the_last_demonstration_and_leave_room_for_a_latent():
    expert = Demonstrations.__new__(Demonstrations)
    expert.lengths = torch.tensor([7, 21])
    assert evenly_spread_rows(expert, 3, 10).tolist() == [7, 12, 17]


def test_latents_are_played_from_the_demonstrated_state_and_drawn(tmp_path):
    env = FurnitureEnv("table_lack", 2, 0, nthread=1, seed=0)
    expert = demonstration(env, 9)
    agent = make_agent()
    paths = play_latents(agent, with_starts(env), expert, torch.tensor([3]))
    assert paths.groupby("latent").size().to_dict() == {-1: 5, 0: 5, 1: 5}
    shown = paths[paths.step == 0][["x", "y", "z"]].to_numpy()
    assert_close(torch.tensor(shown).float(), expert.observations[3, 16:19].expand(3, -1), atol=1e-4, rtol=0)
    last = paths[paths.step == 4].set_index("latent")[["x", "y", "z"]]
    assert (last.loc[0] - last.loc[1]).abs().max() > 1e-5, "two draws do two things"
    assert draw_latents(paths, tmp_path / "latents.png").stat().st_size > 1000
