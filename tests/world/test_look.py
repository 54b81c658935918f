"""What is drawn alone: it is in the picture, and it changes nothing that is simulated."""

import mujoco
import numpy as np
import pytest

import tstar_envs
from tstar_envs import rendering
from tstar_envs.furniture import load, names
from tstar_envs.look import build_drawn_model
from tstar_envs.robots import sawyer
from tstar_envs.robots.sawyer_look import DRAWN_ONLY_GROUP, SIMULATED_GROUP
from tstar_envs.scene import build_model


def follow(model: mujoco.MjModel, steps: int = 400) -> np.ndarray:
    """Positions and velocities (steps, nq + nv) of parts that fall and of an arm that sweeps down through them."""
    data, rows, contacts = mujoco.MjData(model), [], 0
    data.qpos[: sawyer.NUM_JOINTS] = sawyer.HOME_QPOS
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[model.jnt_qposadr[joint] + 2] += 0.02
    for t in range(steps):
        data.ctrl[: sawyer.NUM_JOINTS] = 0.4 * np.sin(0.01 * t + np.arange(sawyer.NUM_JOINTS))
        data.ctrl[1] = 0.3  # the shoulder lowers the hand into the parts
        mujoco.mj_step(model, data)
        contacts = max(contacts, data.ncon)
        rows.append(np.concatenate([data.qpos, data.qvel]))
    assert contacts > 4
    return np.array(rows)


@pytest.mark.parametrize("name", names())
def test_the_drawn_scene_moves_as_the_simulated_one_to_the_bit(name):
    simulated, drawn = build_model(load(name)), build_drawn_model(load(name))
    assert drawn.ngeom > simulated.ngeom + 30
    expected = follow(simulated)
    assert np.abs(expected[-1] - expected[0]).max() > 0.05
    np.testing.assert_array_equal(follow(drawn), expected)


def test_what_is_drawn_alone_touches_and_weighs_nothing():
    simulated, drawn = build_model(load("table_lack")), build_drawn_model(load("table_lack"))
    new = drawn.ngeom - simulated.ngeom
    only = drawn.geom_group == DRAWN_ONLY_GROUP
    assert only.sum() == new and not drawn.geom_contype[only].any() and not drawn.geom_conaffinity[only].any()
    np.testing.assert_array_equal(drawn.body_mass, simulated.body_mass)
    np.testing.assert_array_equal(drawn.body_inertia, simulated.body_inertia)
    hidden = drawn.geom_group == SIMULATED_GROUP
    assert hidden.sum() == (simulated.geom_group == 1).sum(), (
        "the stand-ins of the arm are not drawn any more"
    )


def test_simulations_do_without_it():
    world = tstar_envs.load("table_lack", 1, 0)
    assert world.model.ngeom == build_model(load("table_lack")).ngeom < world.drawn_model.ngeom
    assert world.drawn_model is world.drawn_model and world.drawn_model.nq == world.model.nq


def test_the_pedestal_stands_on_the_floor():
    model = build_drawn_model(load("table_lack"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = model.body("base").id
    mine = [g for g in range(model.ngeom) if model.geom_bodyid[g] == base and model.geom_group[g] == 1]
    bottoms = [data.geom_xpos[g, 2] - model.geom_size[g, 1] for g in mine]
    assert min(bottoms) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", names())
def test_arm_and_parts_are_in_the_picture(name):
    model = build_drawn_model(load(name))
    renderer = rendering.make_renderer(model, 120, 160)
    if renderer is None:
        pytest.skip(rendering.NOTICE)
    home = model.qpos0.copy()
    home[: sawyer.NUM_JOINTS] = sawyer.HOME_QPOS
    image = renderer.draw(home).astype(int)
    red = (image[..., 0] > 60) & (image[..., 0] > 2.5 * image[..., 1]) & (image[..., 0] > 2.5 * image[..., 2])
    assert red.sum() > 500, "the shell of the arm"
    for part in load(name).part_names:
        away = home.copy()
        away[model.jnt_qposadr[model.joint(part).id]] += 50
        assert (renderer.draw(away) != image).any(-1).sum() > 15, part
    renderer.close()
