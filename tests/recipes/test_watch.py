"""The page of `make watch`: two shipped chains from one start, or the scripted assembler; one fails, one assembles."""

import pytest
import torch
from assembled import connector_gaps
from browser import MISSING, Browser, find_chromium
from hydra import compose, initialize_config_dir
from recipe_runs import load_recipe
from tensordict import TensorDict

from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.shipped.catalogue import load_pretrained
from tstar_rl.shipped.chain import load_shipped, save_shipped

TASK = "table_lack"


def test_the_d_omega_of_the_mended_chain_judges_both_sides(monkeypatch, tmp_path):
    skills = [
        Skill(TASK, index, NetworkSettings(hidden=(8,), discriminator_hidden=(8,))) for index in range(2)
    ]
    known = {"task": TASK, "says": "a chain", "figures": {"deterministic": {"success": 0.5, "episodes": 4}}}
    settings = {"narrow_failing": {"velocity_scale": 0.3}, "narrow_mended": {"velocity_scale": 0.4}}
    for name, env in settings.items():
        save_shipped(skills, tmp_path / TASK / name, name == "narrow_mended", **known, env=env)
    recipe = load_recipe("watch")
    monkeypatch.setattr(recipe, "pretrained", lambda: {TASK: list(settings)})
    monkeypatch.setattr(recipe, "load_pretrained", lambda task, name: load_shipped(tmp_path / task / name))
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/watch", ["env.max_steps=7"])
    with pytest.raises(
        InvalidValueError, match=r"give single settings of it, env.<setting>=..., not env=\{...\}"
    ):
        recipe.both_sides(config, ["env={max_steps: 7}"])
    left, right = recipe.both_sides(config, ["env.max_steps=7"])
    assert (left.title, left.success, right.success) == ("a chain (50% of 4 succeed)", False, True)
    assert (
        left.settings == {"velocity_scale": 0.3, "max_steps": 7} and right.settings["velocity_scale"] == 0.4
    )
    observation = torch.randn(3, 72)
    after = TensorDict({"subtask": torch.tensor([[1], [0], [2]]), "observation": observation}, [3])
    step = TensorDict({"subtask": torch.tensor([[0], [0], [1]]), "next": after}, [3])
    said = float(skills[1].d_omega(observation[0]).detach().clamp(0, 1))
    for side in (left, right):
        told = side.signals["d_omega"](step)
        assert float(told[0]) == pytest.approx(said, abs=2e-3) and told[1:].isnan().all()


def test_watch_writes_one_page_with_a_failure_and_a_success(call, tmp_path, capsys):
    call(
        "watch",
        "variants=null",
        "env.max_steps=100",
        "noise=0.8",
        "simulations=1",
        "subtask=0",
        f"runs_dir={tmp_path}",
    )
    said = capsys.readouterr().out.splitlines()
    assert "disturbed: failure after" in said[0] and "scripted assembler: success after" in said[1]
    assert said[2] == str(tmp_path / "watch.html")
    assert [path.name for path in tmp_path.iterdir()] == ["watch.html"]
    assert "leg_2 to table_top" in (tmp_path / "watch.html").read_text()


def test_watch_shows_two_shipped_chains_from_one_start(call, tmp_path, capsys):
    """One subtask is enough to see; the whole task is what `make watch` shows."""
    call("watch", "simulations=1", "subtask=0", f"runs_dir={tmp_path}")
    said = capsys.readouterr().out.splitlines()
    page = (tmp_path / "watch.html").read_text()
    for line, name in zip(said, ("narrow_failing", "narrow_mended"), strict=False):
        record = load_pretrained("table_lack", name).record
        assert record["says"] in page and line.startswith(record["says"]) and line.endswith(" steps")
        assert f"{record['figures']['deterministic']['success']:.0%} of" in page
    assert said[2] == str(tmp_path / "watch.html")


def test_watch_shows_the_script_where_no_chain_is_shipped(call, tmp_path, capsys):
    call("watch", "task=toy_table", "simulations=1", "env.max_steps=2", "subtask=0", f"runs_dir={tmp_path}")
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("toy_table has no such trained chains: the scripted")
    assert "scripted assembler, arm disturbed" in (tmp_path / "watch.html").read_text()


@pytest.mark.slow
@pytest.mark.skipif(find_chromium() is None, reason=MISSING)
def test_the_last_frame_shows_an_assembled_table_on_the_right_alone(call, tmp_path, capsys):
    call("watch", f"runs_dir={tmp_path}")
    said = capsys.readouterr().out.splitlines()
    assert ": failure after" in said[0] and ": success after" in said[1]
    browser = Browser(tmp_path / "profile")
    try:
        browser.open(tmp_path / "watch.html")
        first, last = (
            browser.evaluate(f"(player.seek({place}), player.state())")["panes"]
            for place in ("0", "player.last")
        )
        complaints = browser.complaints()
    finally:
        browser.close()
    assert first[0]["bodies"] == first[1]["bodies"], "not from the same start"
    assert [pane["success"] for pane in last] == [False, True] and not complaints
    failing, mended = (connector_gaps(TASK, pane["bodies"]) for pane in last)
    assert max(mended.values()) < 0.02 < max(failing.values())
