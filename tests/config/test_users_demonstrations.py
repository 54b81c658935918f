"""demonstrations.file names a user's own file, or a folder of them; they are of the config's world."""

import hashlib
import shutil
from pathlib import Path

import pytest
from omegaconf import OmegaConf
from recorded import changed, env_args, leave_two_of_anybody

from tstar_rl.config.demonstrations import digests_of_file, load_demonstrations
from tstar_rl.demonstrations.header import DemonstrationError
from tstar_rl.runs.mismatch import DEMONSTRATIONS_READ


@pytest.fixture
def path(tmp_path) -> Path:
    return leave_two_of_anybody(tmp_path / "mine.hdf5")


@pytest.fixture
def config():
    values = {
        "task": {"name": "chair_ingolf"}, "device": "cpu", "seed": 0, "demonstrations_dir": "none",
        "env": {"velocity_scale": 0.5},
        "demonstrations": {
            "kind": "noisy", "seed": None, "may_differ": [], "file": None, "observation_key": None, "filter_key": None,
        },
    }  # fmt: skip
    return OmegaConf.create(values)


def test_a_config_names_a_file_or_a_folder_of_them(path, config, tmp_path):
    config.demonstrations.file = str(path)
    assert len(load_demonstrations(config, 1)) == 2
    with pytest.raises(
        DemonstrationError, match="is of chair_ingolf, subtask 1; wanted chair_ingolf, subtask 0"
    ):
        load_demonstrations(config, 0)
    shutil.move(path, tmp_path / "subtask1.hdf5")
    config.demonstrations.file = str(tmp_path)
    assert len(load_demonstrations(config, 1)) == 2
    with pytest.raises(FileNotFoundError, match=r"no demonstrations at .*subtask0\.hdf5"):
        load_demonstrations(config, 0)
    with pytest.raises(FileNotFoundError, match=r"no demonstrations at .*whole\.hdf5"):
        load_demonstrations(config, None)


def test_a_file_of_another_world_is_refused_unless_it_may_differ(path, config):
    config.demonstrations.file = str(path)
    config.env = {"velocity_scale": 0.4, "snap": False}  # the file says nothing of snap: it had its default
    with pytest.raises(DemonstrationError, match=r"velocity_scale was 0\.5 .* is 0\.4 now; give the same"):
        load_demonstrations(config, 1)
    config.demonstrations.may_differ = ["velocity_scale"]
    assert len(load_demonstrations(config, 1)) == 2


def test_a_setting_that_the_config_does_not_name_is_compared_too(path, config):
    changed(path, lambda file: file["data"].attrs.update(
        {"env_args": env_args(subtask=1, velocity_scale=0.5, part_noise=0.2)}
    ))  # fmt: skip
    config.demonstrations.file = str(path)
    with pytest.raises(DemonstrationError, match=r"part_noise was 0\.2 when it was saved, and is 0\.02 now"):
        load_demonstrations(config, 1)


def test_the_config_says_which_files_were_read(path, config, tmp_path):
    shutil.copy(path, tmp_path / "subtask1.hdf5")
    config.demonstrations.file = str(tmp_path)
    load_demonstrations(config, 1)
    first = dict(config[DEMONSTRATIONS_READ])
    assert first == {"subtask1": hashlib.sha256(path.read_bytes()).hexdigest()}
    assert digests_of_file(config, first) == first and not digests_of_file(config, ["subtask0"])
    changed(tmp_path / "subtask1.hdf5", lambda file: file["data"].attrs.update({"made_by": "me"}))
    assert digests_of_file(config, first) != first
