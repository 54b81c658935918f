"""The player's page in a headless Chromium: it opens from disk, plays, and its last frame shows an assembled table."""

from pathlib import Path

import numpy as np
import pytest
import torch
from assembled import connector_gaps
from browser import MISSING, Browser, find_chromium
from matplotlib import image as matplotlib_image
from test_player import ARM, episode

from tstar_envs.player import write_player
from tstar_rl import FurnitureEnv
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.watching import record_episode

pytestmark = pytest.mark.skipif(find_chromium() is None, reason=MISSING)
TASK = "table_lack"


def idle(tensordict):
    action = torch.zeros(*tensordict.batch_size, 9)
    action[:, 7:] = -1
    return tensordict.set("action", action)


@pytest.fixture(scope="module")
def episodes():
    """The arm that does nothing for 40 steps, and a whole assembly with a made-up series."""

    def made_up(step):
        done = step["next", "completed"] > step["next", "subtask"] - 1
        changed = step["next", "subtask"] != step["subtask"]
        return torch.where((done & changed).squeeze(-1), 0.75, torch.nan)

    env = FurnitureEnv(TASK, 1, nthread=1, seed=0, snapshots=True)
    short = FurnitureEnv(TASK, 1, nthread=1, seed=0, snapshots=True, max_steps=10)
    return env, [
        record_episode(with_starts(short), idle, "nothing", signals={"made up": made_up}),
        record_episode(with_starts(env), env.expert(), "assembly", signals={"made up": made_up}),
    ]


@pytest.fixture(scope="module")
def page(episodes, tmp_path_factory):
    env, recorded = episodes
    folder = tmp_path_factory.mktemp("player")
    path = env.write_player(folder / "episodes.html", recorded)
    browser = Browser(folder / "profile")
    try:
        browser.open(path)
        yield browser
    finally:
        browser.close()


@pytest.fixture(autouse=True)
def from_the_start(page):
    page.evaluate("player.pause(); player.speed(2); player.seek(0)")
    yield
    assert page.complaints() == [], "errors, or something asked of a network"


def state(page) -> dict:
    return page.evaluate("player.state()")


def picture(page, tmp_path, name: str) -> np.ndarray:
    page.screenshot(tmp_path / f"{name}.png")
    return matplotlib_image.imread(tmp_path / f"{name}.png")[..., :3]


def view_of(page, pane: int) -> tuple[slice, slice]:
    """Where the 3-D view of a pane is in a picture."""
    box = page.evaluate(f"(() => {{ const b = document.querySelectorAll('.view')[{pane}].getBoundingClientRect();"
                        " return [b.top, b.bottom, b.left, b.right].map(Math.round); })()")  # fmt: skip
    return slice(*box[:2]), slice(*box[2:])


def test_the_page_opens_from_disk_with_both_episodes(page, episodes):
    found = state(page)
    left, right = found["panes"]
    assert [left["title"], right["title"]] == ["nothing", "assembly"]
    assert left["drawn"] and right["drawn"] and not found["playing"] and found["time"] == 0
    assert not left["success"] and left["steps"] == 40
    assert right["success"] and right["steps"] == len(episodes[1][1]["reward"]) == found["last"]
    assert page.evaluate("location.protocol") == "file:"
    assert min(connector_gaps(TASK, right["bodies"]).values()) > 0.1


def test_the_last_frame_shows_an_assembled_table(page, tmp_path):
    where = view_of(page, 1)
    before = picture(page, tmp_path, "before")
    page.press("End")
    page.wait_for("player.state().time === player.last")
    left, right = state(page)["panes"]
    assert right["subtask"] == 4 and max(connector_gaps(TASK, right["bodies"]).values()) < 0.02
    assert left["step"] == 40 and min(connector_gaps(TASK, left["bodies"]).values()) > 0.1
    after = picture(page, tmp_path, "after")
    assert (np.abs(after - before).max(-1) > 0.1)[where].mean() > 0.01, (
        "the table is not drawn as it was before"
    )
    green = (after[..., 1] > after[..., 0] + 0.1) & (after[..., 1] > after[..., 2] + 0.1)
    assert green[where].sum() > 100, "a leg is green"
    text = page.evaluate("document.querySelectorAll('.readout')[1].textContent")
    assert "all subtasks done" in text and "last made up 0.75" in text


def test_it_plays_to_the_end(page):
    page.evaluate("player.speed(0)")  # the slowest: a busy machine is asked before it comes to the end
    page.press(" ")
    page.wait_for("player.state().playing && player.state().time > 1")
    page.press(" ")
    page.wait_for("!player.state().playing")
    stopped = state(page)["time"]
    assert stopped < page.evaluate("player.last")
    page.evaluate("player.speed(8); player.seek(player.last - 5); player.play()")
    page.wait_for("!player.state().playing")
    assert state(page)["time"] == page.evaluate("player.last")


def test_keys_go_by_steps_subtasks_and_speeds(page, episodes):
    times = []
    for key, shift in (("ArrowRight", False), ("ArrowRight", True), ("ArrowLeft", False)):
        page.press(key, shift)
        times.append(state(page)["time"])
    assert times == [1, 11, 10]
    page.press("Home")
    subtask = episodes[1][1]["subtask"]
    starts = [t for t in range(1, len(subtask)) if subtask[t] != subtask[t - 1]]
    for start in starts[:2]:
        page.press("n")
        assert state(page)["time"] == start and state(page)["panes"][1]["subtask"] == subtask[start]
    page.press("p")
    assert state(page)["time"] == starts[0]
    page.press("]")
    assert state(page)["speed"] == 4
    page.press("[")
    page.press("[")
    assert state(page)["speed"] == 1


def test_the_mouse_turns_and_zooms_both_views(page, tmp_path):
    before, camera = picture(page, tmp_path, "before"), state(page)["camera"]
    page.mouse("mousePressed", 250, 250, button="left", buttons=1, clickCount=1)
    page.mouse("mouseMoved", 330, 270, button="left", buttons=1)
    page.mouse("mouseReleased", 330, 270, button="left")
    turned = state(page)["camera"]
    assert turned["azimuth"] < camera["azimuth"] - 10 and turned["elevation"] > camera["elevation"] + 2
    page.mouse("mouseWheel", 250, 250, deltaX=0, deltaY=-300)
    assert state(page)["camera"]["distance"] < 0.9 * camera["distance"]
    after = picture(page, tmp_path, "after")
    for pane in (0, 1):
        assert (np.abs(after - before).max(-1) > 0.1)[view_of(page, pane)].mean() > 0.05
    page.press("r")
    assert state(page)["camera"] == camera


def test_a_click_in_the_timeline_goes_there(page):
    box = page.evaluate("(() => { const b = document.querySelectorAll('.timeline')[1].getBoundingClientRect();"
                        " return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
    x, y = box[0] + 62 + (box[2] - 70) / 2, box[1] + box[3] / 2
    page.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
    page.mouse("mouseReleased", x, y, button="left")
    assert state(page)["time"] == pytest.approx(page.evaluate("player.last") / 2, rel=0.02)


@pytest.fixture
def other_page(page):
    """Opens another page in the same browser; afterwards the first is there again."""
    back = page.evaluate("location.pathname")
    yield page.open
    page.open(Path(back))


def test_an_episode_is_chosen_with_keys(page, other_page, tmp_path):
    recorded = [episode(ARM, 2, title=f"take {number}") for number in range(4)]
    other_page(write_player(tmp_path / "four.html", ARM, recorded))
    page.evaluate("document.querySelector('select').focus()")
    for number in (1, 2, 3):
        page.press("ArrowDown")
        page.wait_for(f"player.state().panes[0].title === 'take {number}'")
    named = "Array.from(document.querySelectorAll('select, canvas')).every((e) => e.ariaLabel || e.labels?.length)"
    assert page.evaluate(named)


@pytest.mark.slow
def test_a_recording_of_many_steps_is_drawn(page, other_page, tmp_path):
    """A call takes some 125,000 arguments, and an episode may have more steps."""
    other_page(write_player(tmp_path / "long.html", ARM, [episode(ARM, 130_000)]))
    page.evaluate("player.seek(129000)")
    page.wait_for("document.querySelector('.readout').textContent.includes('step 129000 of 130000')")


def test_two_panes_count_subtasks_alike(page, other_page, tmp_path):
    """A success of one subtask beside a failure, without names: the last state of the success is past them all."""
    ends = ([0, 0, 1], True), ([0, 0, 0], False)
    recorded = [episode(ARM, 2, subtask=np.array(subtask), success=success) for subtask, success in ends]
    texts = "Array.from(document.querySelectorAll('.readout')).map((p) => p.textContent)"
    other_page(write_player(tmp_path / "a.html", ARM, recorded))
    page.wait_for(f"{texts}.every((text) => text.includes('subtask 1 of 1'))")
    page.evaluate("player.seek(player.last)")
    page.wait_for(f"{texts}[0].includes('all subtasks done') && {texts}[1].includes('subtask 1 of 1')")
