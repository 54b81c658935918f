"""What MuJoCo warns of between steps, in the simulation of dm_control's physics: the next step says so."""

import numpy as np

import tstar_envs


def test_a_state_that_mujoco_gives_up_on_is_a_failure_of_the_next_step():
    env = tstar_envs.load_dm("table_lack", 0, 0)
    env.reset()
    env.physics.data.qpos[2] = 1e11
    env.physics.view.refresh()  # MuJoCo warns here, and puts all back
    step = env.step(np.zeros(9))
    assert step.last() and step.discount == 0.0 and env.world.failures == 1
    env.reset()
    assert not env.step(np.zeros(9)).last() and env.world.failures == 1
