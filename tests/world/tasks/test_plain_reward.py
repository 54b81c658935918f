"""The tables of the reward against its definition, to the bit, along episodes."""

import plain_reward
import pytest
import torch
from worlds import PIECES, make

from tstar_envs import geometry


@pytest.mark.parametrize(
    "name",
    [
        *PIECES,
        pytest.param("chair_bernhard", marks=pytest.mark.slow),  # along an axis
        pytest.param("table_dockstra", marks=pytest.mark.slow),  # from the side
    ],
)
def test_every_step_of_noisy_episodes_pays_what_the_definition_says(name):
    world = make(6, None, 1, name)
    task, tables, expert = world.task, world.task.tables, world.expert()
    generator, phases, most = torch.Generator().manual_seed(0), set(), 0
    for _ in range(300):
        action = expert.act(world.state)
        action[3:, :7] += 0.2 * torch.randn(3, 7, generator=generator, dtype=torch.float64)  # drops parts
        action[torch.rand(6, generator=generator) < 0.05, 8] = 1.0  # asks too early
        before = dict(world.state)
        welds, restart = world.physics.eq_active.clone(), torch.stack(task.get_termination(before)).any(0)
        world.step(action)
        connected = (world.physics.eq_active != welds).any(-1)
        now = task.scene(before)
        wanted = plain_reward.reward(task, before, now, action.clamp(-1, 1), connected)
        unmoved = ~connected  # where parts were joined, the arm went home before one could look
        assert torch.equal(world.state["reward"][unmoved], wanted[unmoved])
        kept = plain_reward.potentials(now, before["start_tip"], before["lift_point"], tables.z_finedist)
        torch.testing.assert_close(world.state["potential"][unmoved], kept[unmoved])
        assert torch.equal(world.state["grip_action"][unmoved], action[unmoved, 7].clamp(-1, 1))
        assert all(
            map(torch.equal, now.alignment, plain_reward.alignment(task, now, before["subtask"]))
        ) and torch.equal(now.aligned, now.alignment.aligned)
        phases |= set(before["phase"][unmoved].tolist())
        k = tables.step_index(before["subtask"])
        part = task.part_poses[torch.arange(6), tables.moving[k]]
        grasp = part[:, :3] + geometry.quat_rotate(part[:, 3:], tables.grasp_point[k])
        torch.testing.assert_close(now.grasp_point, grasp)
        target = geometry.quat_to_matrix(task.part_poses[torch.arange(6), tables.target[k], 3:])
        torch.testing.assert_close(now.way_out, tables.approach_direction(k, target))
        assert torch.equal(now.retreat, tables.retreat[k])
        most = max(most, int(world.state["completed"].max()))
        if restart.any():
            world.reset(restart)
    assert phases >= set(range(1, 7)) and most > 1
