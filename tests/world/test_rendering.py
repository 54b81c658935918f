"""Pictures of states, where this machine can draw."""

import errno
import os
import subprocess
import sys

import imageio.v3
import numpy as np
import pytest

from tstar_envs import rendering
from tstar_envs.furniture import load
from tstar_envs.scene import build_model


@pytest.fixture(scope="module")
def model():
    return build_model(load("table_lack"))


@pytest.fixture(scope="module")
def renderer(model):
    renderer = rendering.make_renderer(model, 120, 160)
    if renderer is None:
        pytest.skip(rendering.NOTICE)
    yield renderer
    renderer.close()


def test_a_state_becomes_a_picture_in_which_a_moved_leg_shows(model, renderer):
    image = renderer.draw(model.qpos0)
    assert image.shape == (120, 160, 3) and image.dtype == np.uint8 and image.std() > 10
    moved = model.qpos0.copy()
    moved[model.jnt_qposadr[model.joint("leg_1").id] + 2] += 0.2
    assert (renderer.draw(moved) != image).any()
    np.testing.assert_array_equal(renderer.draw(model.qpos0), image)


def test_table_legs_and_arm_are_in_view(model, renderer):
    """Each part and the hand changes the picture when it is taken away."""
    image = renderer.draw(model.qpos0)
    for body in ("leg_1", "leg_2", "leg_3", "leg_4", "table_top"):
        away = model.qpos0.copy()
        away[model.jnt_qposadr[model.joint(body).id]] += 50
        assert (renderer.draw(away) != image).any(-1).sum() > 20, body
    bent = model.qpos0.copy()
    bent[1] += 0.5
    assert (renderer.draw(bent) != image).any(-1).sum() > 20


def test_a_rough_picture_shows_the_same_and_leaves_the_model_as_it_was(model, renderer):
    quality = model.vis.quality
    before = quality.offsamples, quality.shadowsize
    rough = rendering.make_renderer(model, 120, 160, smooth=False)
    assert (quality.offsamples, quality.shadowsize) == before
    difference = abs(rough.draw(model.qpos0).astype(int) - renderer.draw(model.qpos0))
    rough.close()
    assert 0 < (difference > 8).any(-1).mean() < 0.1  # along edges alone


def test_files_are_written(tmp_path, model, renderer):
    image = renderer.draw(model.qpos0)
    rendering.write_png(tmp_path / "a" / "state.png", image)
    np.testing.assert_array_equal(imageio.v3.imread(tmp_path / "a" / "state.png")[..., :3], image)
    moved = model.qpos0.copy()
    frames = []
    for step in range(5):
        moved[model.jnt_qposadr[model.joint("leg_1").id] + 2] = 0.1 * step
        frames.append(renderer.draw(moved).copy())
    rendering.write_mp4(tmp_path / "film.mp4", frames)
    film = imageio.v3.imread(tmp_path / "film.mp4").astype(float)
    assert film.shape == (5, *image.shape)
    for index, frame in enumerate(film):  # compressed, but each is nearest to the picture that it shows
        assert np.argmin([abs(frame - drawn).mean() for drawn in frames]) == index


def test_a_backend_that_is_asked_for_after_mujoco_was_imported_draws(renderer):
    """As in a notebook: MuJoCo has read MUJOCO_GL long before."""
    script = (
        "import os, mujoco; from tstar_envs import rendering\n"
        f"os.environ['MUJOCO_GL'] = {rendering.backend()!r}\n"
        "seen = '<mujoco><worldbody><camera name=\"workplace\"/></worldbody></mujoco>'\n"
        "model = mujoco.MjModel.from_xml_string(seen)\n"
        "print(rendering.make_renderer(model, 16, 16).draw([]).shape)"
    )
    environment = {
        key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")
    }
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
    assert done.stdout.strip() == "(16, 16, 3)", done.stderr


@pytest.mark.parametrize(
    "name, count, message",
    [
        ("film.avi", 1, r"ends in .mp4, got '\S+film.avi'"),
        ("film", 1, r"ends in .mp4, got '\S+film'"),
        ("film.mp4", 0, r"at least one frame, got none for '\S+film.mp4'"),
    ],
)
def test_a_film_that_cannot_be_leaves_an_earlier_one(tmp_path, name, count, message):
    (tmp_path / name).write_text("earlier")
    with pytest.raises(ValueError, match=message):
        rendering.write_mp4(tmp_path / name, [np.zeros((64, 64, 3), dtype=np.uint8)] * count)
    assert (tmp_path / name).read_text() == "earlier"


def test_what_draws_the_frames_fails_as_itself_and_leaves_what_was_there(tmp_path):
    def frames():
        yield np.zeros((64, 64, 3), dtype=np.uint8)
        raise FileNotFoundError("a frame")

    for there in ((), ("film.mp4",)):
        for name in there:
            (tmp_path / name).write_text("earlier")
        with pytest.raises(FileNotFoundError, match="a frame"):
            rendering.write_mp4(tmp_path / "film.mp4", frames())
        assert [path.name for path in tmp_path.iterdir()] == list(there)
    assert (tmp_path / "film.mp4").read_text() == "earlier"


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (0, "must be positive, got 0"),
        (-5, "must be positive"),
        (float("nan"), "must be a finite number, got nan"),
    ],
)
def test_a_rate_of_frames_that_cannot_be_leaves_an_earlier_film(tmp_path, rate, message):
    (tmp_path / "film.mp4").write_text("earlier")
    with pytest.raises(ValueError, match=f"frames_per_second {message}"):
        rendering.write_mp4(tmp_path / "film.mp4", [np.zeros((64, 64, 3), dtype=np.uint8)], rate)
    assert (tmp_path / "film.mp4").read_text() == "earlier"


def test_a_picture_that_cannot_be_written_leaves_an_earlier_one(tmp_path, monkeypatch):
    from matplotlib import image

    def full(path, *_, **__):
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / "state.png").write_text("earlier")
    monkeypatch.setattr(image, "imsave", full)
    with pytest.raises(OSError, match="No space left"):
        rendering.write_png(tmp_path / "state.png", np.zeros((4, 4, 3), dtype=np.uint8))
    assert [path.read_text() for path in tmp_path.iterdir()] == ["earlier"]


def test_mistakes_are_told(model, renderer):
    with pytest.raises(ValueError, match="no camera is called 'above'; valid: 'workplace'"):
        rendering.make_renderer(model, camera="above")
    with pytest.raises(ValueError, match=r"shape \(44,\), got \(3,\)"):
        renderer.draw(np.zeros(3))


@pytest.mark.parametrize(
    "asked, message",
    [
        ("", "neither EGL nor OSMesa works here.*libosmesa6"),
        ("EGL", "MUJOCO_GL asks for egl, which does not"),
        ("off", "MUJOCO_GL=off says so"),
        ("Disable", "MUJOCO_GL=disable says so"),
    ],
)
def test_where_nothing_can_be_drawn_one_sentence_says_so(monkeypatch, model, asked, message):
    monkeypatch.setenv("MUJOCO_GL", asked)
    monkeypatch.setenv("PYOPENGL_PLATFORM", "")
    monkeypatch.setattr(rendering.subprocess, "run", lambda *a, **k: type("Failed", (), {"returncode": 1}))
    rendering.backend.cache_clear()
    try:
        with pytest.warns(UserWarning, match=message):
            assert rendering.make_renderer(model) is None
        assert rendering.make_renderer(model) is None
    finally:
        rendering.backend.cache_clear()


@pytest.mark.parametrize(
    "also",
    [
        "",
        pytest.param(  # dm_control, which draws on the same display, ends it first
            "dm = tstar_envs.load_dm('table_lack')\ndm.reset()\ndm.physics.render(48, 64, camera_id=0)\n",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_script_that_ends_without_closing_ends_without_a_traceback(renderer, also):
    script = (
        "import gymnasium, tstar_envs\n"
        "env = gymnasium.make('tstar/TableLack-v0', render_mode='rgb_array', width=64, height=48)\n"
        "env.reset(seed=0)\n"
        f"assert env.render().any()\n{also}"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
