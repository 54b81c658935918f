"""What is learned from was made in the world of the config; what was made otherwise is told, and never made again."""

from dataclasses import replace
from pathlib import Path

import pytest
from omegaconf import DictConfig, OmegaConf
from recorded import made_up

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.demonstrations import check_made, load_demonstrations
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.header import DemonstrationError
from tstar_rl.env.task_tables import furniture_digest


@pytest.fixture
def demonstrations() -> Demonstrations:
    return made_up()


def config(folder: Path, **env) -> DictConfig:
    values = {"kind": "noisy", "may_differ": [], "seed": 0, "episodes": 2, "noise": 0.15}
    config = {"task": {"name": "table_lack"}, "demonstrations_dir": str(folder), "device": "cpu"}
    return OmegaConf.create({**config, "demonstrations": values, "env": {"velocity_scale": 0.4, **env}})


def place(folder: Path) -> Path:
    return folder / "table_lack" / "seed0" / "subtask2_noisy.npz"


def test_those_of_another_world_are_refused_unless_they_may_differ(demonstrations, tmp_path):
    asked = config(tmp_path, snap=True)
    demonstrations.arguments["snap"] = False
    demonstrations.save(place(tmp_path))
    with pytest.raises(DemonstrationError, match="snap was False when it was saved, and is True now"):
        load_demonstrations(asked, 2)
    asked.demonstrations.may_differ = ["snap"]
    assert len(load_demonstrations(asked, 2)) == 2
    asked.env.skipped_phases = "paid"  # older than the setting: they were made with its default
    assert len(load_demonstrations(asked, 2)) == 2
    asked.env.skipped_phases = "unpaid"
    with pytest.raises(DemonstrationError, match="skipped_phases was 'paid' when it was saved"):
        load_demonstrations(asked, 2)
    asked.demonstrations.may_differ = ["snap", "skipped_phases"]
    asked.env.velocity_scale = 1.0
    with pytest.raises(DemonstrationError, match=r"velocity_scale was 0\.4"):
        load_demonstrations(asked, 2)


def test_a_setting_that_the_config_leaves_at_its_default_is_compared_too(demonstrations, tmp_path):
    demonstrations.arguments |= {"reset_robot": False, "retreat_steps": 4, "arm_noise": 0.2, "max_steps": 60}
    demonstrations.save(place(tmp_path))
    with pytest.raises(DemonstrationError) as said:
        load_demonstrations(config(tmp_path), 2)
    for name, was, now in (("reset_robot", False, True), ("retreat_steps", 4, 0), ("arm_noise", 0.2, 0.001)):
        assert f"{name} was {was} when it was saved, and is {now} now" in str(said.value)
    assert "max_steps" not in str(said.value)  # a success is one with any later time limit
    asked = config(tmp_path, reset_robot=False, retreat_steps=4)
    asked.demonstrations.may_differ = ["arm_noise"]
    assert len(load_demonstrations(asked, 2)) == 2


def test_what_may_differ_is_a_setting(demonstrations, tmp_path):
    demonstrations.save(place(tmp_path))
    asked = config(tmp_path)
    asked.demonstrations.may_differ = ["snapp"]
    told = r"may_differ has 'snapp'; valid settings: .*; did you mean snap\?"
    with pytest.raises(InvalidValueError, match=told):
        load_demonstrations(asked, 2)


def test_those_of_another_kind_are_refused(demonstrations, tmp_path):
    """A copy under the other name: nothing is learned from it that config.yaml does not say."""
    demonstrations.save(place(tmp_path).with_name("subtask2_plain.npz"))
    asked = config(tmp_path)
    asked.demonstrations.kind = "plain"
    with pytest.raises(DemonstrationError, match="kind was 'noisy' when it was saved, and is 'plain' now"):
        load_demonstrations(asked, 2)
    with pytest.raises(DemonstrationError, match="kind was 'noisy' when it was saved, and is 'plain' now"):
        check_made(asked, 2, "plain")


def test_those_of_another_file_of_furniture_are_refused_and_told_what_else_is_old(demonstrations, tmp_path):
    replace(demonstrations, furniture=furniture_digest("table_lack")).save(place(tmp_path))
    assert load_demonstrations(config(tmp_path), 2).furniture == furniture_digest("table_lack")
    check_made(config(tmp_path), 2, "noisy")
    replace(demonstrations, furniture=furniture_digest("toy_table")).save(
        place(tmp_path)
    )  # stands for an edited one
    told = "made with another table_lack.yaml than there is now, and so were the skills, chains and tables"
    check_made(config(tmp_path), 2, "noisy", furniture=False)  # as of a step with the code of another commit
    for asked in (
        lambda: load_demonstrations(config(tmp_path), 2),
        lambda: check_made(config(tmp_path), 2, "noisy"),
    ):
        with pytest.raises(DemonstrationError, match=told):
            asked()


def test_a_file_is_kept_if_it_is_what_would_be_made(demonstrations, tmp_path):
    with pytest.raises(FileNotFoundError):
        check_made(config(tmp_path), 2, "noisy")
    replace(demonstrations, noise=0.15).save(place(tmp_path))
    assert Demonstrations.load(place(tmp_path)).noise == 0.15
    asked = config(tmp_path)
    check_made(asked, 2, "noisy")
    asked.demonstrations.update({"episodes": 100, "noise": 0.3})
    asked.env.snap = True
    with pytest.raises(DemonstrationError) as said:
        check_made(asked, 2, "noisy")
    for text in (
        str(place(tmp_path)), "snap was False", "it has 2 episodes, and demonstrations.episodes is 100",
        "a noise of 0.15, and demonstrations.noise is 0.3", "delete it, or set resume=false, to make it again",
    ):  # fmt: skip
        assert text in str(said.value)
    with pytest.raises(
        DemonstrationError, match="has 2 episodes, .*is 100; .*noise of 0.15, .* is 0.3; give the same, or"
    ):
        load_demonstrations(asked, 2)  # whose config.yaml would say what is not so
    assert len(load_demonstrations(config(tmp_path), 2)) == 2
    demonstrations.save(place(tmp_path))  # an older file: it does not say with which noise
    asked = config(tmp_path)
    asked.demonstrations.noise = 0.3
    check_made(asked, 2, "noisy")
