"""The way home, in the real scene."""

import pytest
import torch

from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.env.homing import ARRIVED, way_home
from tstar_rl.env.layout import NUM_PHASES, PARTS


@pytest.mark.parametrize("scale", [0.4, 1.0])
def test_the_arm_arrives_at_home_and_touches_nothing(scale):
    env = FurnitureEnv("table_lack", 16, seed=0, velocity_scale=scale, arm_noise=0.2)
    now = env.reset()
    home = FurnitureEnv("table_lack", 1, seed=0, arm_noise=0.0).reset()["observation"][0, :7]
    parts = now["observation"][:, PARTS:-NUM_PHASES]
    assert ((now["observation"][:, :7] - home).abs().amax(-1) > ARRIVED).all()
    steps, arrived = torch.zeros(16), torch.zeros(16, dtype=torch.bool)
    for _ in range(40):
        action, arrived = way_home(now["observation"], scale)
        assert action.shape == (16, 9) and action.abs().max() <= 1.0 and (action[:, 7:] == -1.0).all()
        if arrived.all():
            break
        steps += ~arrived
        now = env.step_mdp(env.step(now.set("action", action)))
    assert arrived.all()
    assert ((now["observation"][:, :7] - home).abs() < ARRIVED).all()
    assert (now["observation"][:, PARTS:-NUM_PHASES] - parts).abs().max() < 0.01
    assert steps.max() <= (25 if scale == 0.4 else 15)
