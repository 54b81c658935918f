"""Episodes as a file: what is written of bodies, geoms and numbers. How the page plays is in test_player_page.py."""

import base64
import json
import re

import mujoco
import numpy as np
import pytest

from tstar_envs.furniture import load, names
from tstar_envs.look import build_drawn_model
from tstar_envs.player import Episode, write_player
from tstar_envs.player.episode import body_poses
from tstar_envs.player.geometry import scene
from tstar_envs.scene import build_model

ARM = mujoco.MjModel.from_xml_string("""
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body pos="0 0 2"><geom name="shelf" type="box" size="1 2 3" pos="1 0 0" quat="0 1 0 0"/></body>
    <body name="bar" pos="0 0 1">
      <joint type="hinge" axis="0 0 1"/>
      <geom type="capsule" size="0.1 0.5" rgba="1 0 0 1"/>
      <geom type="sphere" size="0.2" group="3"/>
      <geom type="sphere" size="0.2" rgba="1 1 1 0"/>
      <body name="tip" pos="1 0 0"><joint type="slide" axis="1 0 0"/><geom type="sphere" size="0.1"/></body>
    </body>
  </worldbody>
</mujoco>
""")


def episode(model, steps: int = 3, **changes) -> Episode:
    values = {
        "title": "first",
        "positions": np.tile(model.qpos0, (steps + 1, 1)),
        "subtask": np.zeros(steps + 1),
        "phase": np.arange(steps + 1),
        "reward": np.arange(steps) / 3,
        "success": True,
    }
    return Episode(**{**values, **changes})


def content(path) -> dict:
    """What a page has been given."""
    found = re.search(r'<script id="content" type="application/json">(.*?)</script>', path.read_text(), re.S)
    assert found
    return json.loads(found[1])


def test_bodies_are_where_the_joints_put_them():
    # A quarter turn about z at (0, 0, 1), and the tip 1 m and then 0.5 m further out.
    poses = body_poses(ARM, np.array([[0.0, 0.0], [np.pi / 2, 0.5]]))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(poses[0], [[0, 0, 1, 1, 0, 0, 0], [1, 0, 1, 1, 0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(
        poses[1], [[0, 0, 1, half, 0, 0, half], [0, 1.5, 1, half, 0, 0, half]], atol=1e-12
    )


def test_geoms_that_are_seen_are_written_with_the_body_that_moves_them():
    found = scene(ARM)
    assert found["bodies"] == ["bar", "tip"]
    floor, shelf, bar, tip = found["geoms"]  # neither the one of a hidden group nor the transparent one
    assert [floor["shape"], shelf["shape"], bar["shape"], tip["shape"]] == [
        "plane",
        "box",
        "capsule",
        "sphere",
    ]
    assert [floor["body"], shelf["body"], bar["body"], tip["body"]] == [-1, -1, 0, 1]
    assert shelf["pos"] == [1, 0, 2] and shelf["size"] == [1, 2, 3]
    assert np.abs(shelf["quat"]).tolist() == [0, 1, 0, 0] and bar["rgba"] == [1, 0, 0, 1]


@pytest.mark.parametrize("name", names())
def test_any_furniture_is_written(tmp_path, name):
    model = build_drawn_model(load(name))
    parts = load(name).part_names
    path = write_player(tmp_path / "new" / "player.html", model, [episode(model)], title=name)
    written = content(path)
    assert written["title"] == name and set(parts) < set(written["scene"]["bodies"])
    (one,) = written["episodes"]
    poses = np.frombuffer(base64.b64decode(one["poses"]), "<f4").reshape(4, -1, 7)
    assert poses.shape[1] == len(written["scene"]["bodies"])
    part = written["scene"]["bodies"].index(parts[0])
    np.testing.assert_allclose(poses[2, part], load(name).parts[0].initial_pose, atol=1e-4)


def test_the_page_asks_for_nothing_and_a_title_cannot_end_its_script(tmp_path):
    title = "</script><script>alert(1)</script>"
    path = write_player(tmp_path / "a.html", ARM, [episode(ARM, title=title)], title=title)
    text = path.read_text()
    assert content(path)["episodes"][0]["title"] == title and text.count("</script>") == 2
    assert not re.search(r"(src|href)\s*=|https?://|@import|url\(", text)


def test_a_long_episode_stays_well_below_a_megabyte(tmp_path):
    model = build_drawn_model(load("table_lack"))
    rng = np.random.default_rng(0)
    steps = 800  # four subtasks of 200 steps, the default limit
    noisy = rng.normal(size=(steps + 1, model.nq))
    path = write_player(tmp_path / "a.html", model, [episode(model, steps, positions=noisy)])
    assert path.stat().st_size < 700_000


def test_a_number_that_there_is_not_is_null(tmp_path):
    series = {"d_omega": np.array([np.nan, 0.25, np.nan])}
    written = content(write_player(tmp_path / "a.html", ARM, [episode(ARM, series=series)]))
    assert written["episodes"][0]["series"] == {"d_omega": [None, 0.25, None]}
    assert written["episodes"][0]["reward"] == pytest.approx([0, 1 / 3, 2 / 3], rel=1e-5)


@pytest.mark.parametrize(
    "ends, count",
    [
        ([([0, 0, 1], True)], 1),
        ([([0, 0, 1], False)], 2),
        ([([0, 0, 0], False), ([0, 0, 1], True)], 1),
        ([([0, 1, 1], False), ([0, 1, 3], True)], 3),
        ([([0, 0, 0], True)], 1),
    ],
)
def test_subtasks_without_names_are_counted_over_all_episodes(tmp_path, ends, count):
    episodes = [episode(ARM, 2, subtask=np.array(subtask), success=success) for subtask, success in ends]
    assert content(write_player(tmp_path / "a.html", ARM, episodes))["subtaskCount"] == count
    named = write_player(tmp_path / "b.html", ARM, episodes, subtasks=["a", "b", "c", "d"])
    assert content(named)["subtaskCount"] == 4


def test_mistakes_are_told(tmp_path):
    with pytest.raises(ValueError, match="needs at least one episode, got none"):
        write_player(tmp_path / "a.html", ARM, [])
    with pytest.raises(ValueError, match=r"'first': positions have shape \(T \+ 1, nq\).*got \(1, 2\)"):
        episode(ARM, 0)
    with pytest.raises(ValueError, match=r"'first': reward has shape \(3,\) beside 4 positions, got \(4,\)"):
        episode(ARM, reward=np.zeros(4))
    with pytest.raises(ValueError, match=r"'first': value has shape \(3,\)"):
        episode(ARM, series={"value": np.zeros(2)})
    with pytest.raises(ValueError, match="reward must be finite"):
        episode(ARM, reward=np.array([0, np.nan, 0]))
    for wrong in ([0, np.nan, 0, 0], [0, 1.7, 0, 0], [0, -1, 0, 0]):
        for name in ("subtask", "phase"):
            with pytest.raises(ValueError, match=f"'first': {name} must be whole numbers from 0"):
                episode(ARM, **{name: np.array(wrong)})
    with pytest.raises(ValueError, match="a series may not be called reward, a row that is there"):
        episode(ARM, series={"reward": np.zeros(3)})
    with pytest.raises(ValueError, match="the episodes have 3 subtasks, got 1 names: lift"):
        write_player(tmp_path / "a.html", ARM, [episode(ARM, subtask=np.arange(4))], subtasks=["lift"])
    for seconds in (0.0, np.nan):
        with pytest.raises(ValueError, match="step_seconds must be positive, got"):
            write_player(tmp_path / "a.html", ARM, [episode(ARM)], step_seconds=seconds)
    with pytest.raises(ValueError, match=r"shape \(44,\), got \(2,\)"):
        write_player(tmp_path / "a.html", build_model(load("table_lack")), [episode(ARM)])
    spec = mujoco.MjSpec.from_string("<mujoco/>")
    spec.add_mesh(name="m", uservert=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    spec.worldbody.add_geom(name="blob", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    with pytest.raises(
        ValueError, match="geom blob is a mesh, which the player cannot draw; it draws plane, sphere"
    ):
        scene(spec.compile())
