"""The scene as XML is the scene: what other programs read from it has the same bodies, joints, welds and sensors."""

import mujoco
import numpy as np
import pytest

from tstar_envs.furniture import library
from tstar_envs.scene import build_model, scene_xml

SEEN = ("cam_", "light_", "tex_", "vis")  # of what is only drawn, directions are rounded


@pytest.mark.parametrize("name", library.names())
def test_a_model_read_from_the_xml_is_the_scene_s(name):
    model, read = (
        build_model(library.load(name)),
        mujoco.MjModel.from_xml_string(scene_xml(library.load(name))),
    )
    compared = 0
    for field in dir(model):
        ours, theirs = getattr(model, field), getattr(read, field)
        if isinstance(ours, np.ndarray) and ours.dtype.kind in "fiub" and not field.startswith(SEEN):
            assert ours.shape == theirs.shape, field
            assert np.allclose(ours, theirs, rtol=1e-12, atol=1e-12), field
            compared += 1
    assert compared > 200
    full = mujoco.mjtState.mjSTATE_INTEGRATION
    assert mujoco.mj_stateSize(model, full) == mujoco.mj_stateSize(read, full)
    assert model.body("left_finger").mass[0] == 0.03  # without care its mass would not be written
