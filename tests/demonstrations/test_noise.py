"""The noise that demonstrations were made with goes out with them, comes back, and is held against the config's."""

from dataclasses import replace
from pathlib import Path

import h5py
import pytest
from omegaconf import DictConfig, OmegaConf
from recorded import as_demonstrations, changed, leave_two_of_anybody, make, scripted

from tstar_rl.config.demonstrations import load_demonstrations
from tstar_rl.demonstrations.file_check import DemonstrationError
from tstar_rl.demonstrations.formats import (
    Recording,
    read_demonstrations,
    read_hdf5,
    replay_demonstrations,
    write_hdf5,
    write_minari,
)
from tstar_rl.env.task_tables import furniture_digest

NOISE, DATASET = 0.15, "tstar/chair/noisy-v0"


@pytest.fixture(scope="module")
def recording() -> Recording:
    """The library's own demonstrations, played again."""
    return replay_demonstrations(make(), replace(as_demonstrations(scripted()), noise=NOISE)).successes


@pytest.fixture
def path(recording, tmp_path) -> Path:
    return write_hdf5(recording, tmp_path / "noisy.hdf5")


def test_an_exported_file_says_it_and_it_is_read_again(recording, path):
    assert recording.noise == NOISE
    with h5py.File(path) as file:
        assert file["data"].attrs["noise"] == NOISE
    assert read_demonstrations(path).noise == NOISE and read_hdf5(path).noise == NOISE


def test_a_file_that_does_not_say_it_is_taken(recording, tmp_path):
    path = write_hdf5(replace(recording, noise=None), tmp_path / "older.hdf5")
    with h5py.File(path) as file:
        assert "noise" not in file["data"].attrs
    assert read_demonstrations(path).noise is None and read_hdf5(path).noise is None
    assert read_demonstrations(leave_two_of_anybody(tmp_path / "mine.hdf5")).noise is None


@pytest.mark.parametrize(
    ("value", "told"),
    [("little", "'little'"), (-0.1, r"-0\.1"), (float("nan"), "nan"), (True, "True"), ([0.1], r"array\(\[0\.1\]\)")],
)  # fmt: skip
def test_it_is_a_number_from_0(path, value, told):
    changed(path, lambda file: file["data"].attrs.update({"noise": value}))
    for read in (read_demonstrations, read_hdf5):
        with pytest.raises(
            DemonstrationError, match=rf"noisy\.hdf5: attribute noise of data is {told}, should be one num"
        ):
            read(path)


def test_minari_s_metadata_says_it(recording, tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    write_minari(recording, DATASET, tmp_path)
    assert minari.load_dataset(DATASET).storage.metadata["noise"] == NOISE
    write_minari(replace(recording, noise=None), DATASET, tmp_path)
    assert "noise" not in minari.load_dataset(DATASET).storage.metadata


def config(path: Path, noise: float) -> DictConfig:
    values = {"kind": "noisy", "noise": noise, "seed": None, "may_differ": [], "file": str(path)}
    values |= {"observation_key": None, "filter_key": None}
    return OmegaConf.create(
        {"task": {"name": "chair_ingolf"}, "device": "cpu", "demonstrations": values, "env": {}}
    )


def test_a_file_of_another_noise_is_refused_as_the_library_s_own_are(recording, path, tmp_path):
    assert load_demonstrations(config(path, NOISE), 1).noise == NOISE
    asked = config(path, 0.3)
    with pytest.raises(
        DemonstrationError,
        match=r"it was made with a noise of 0\.15, and demonstrations\.noise is 0\.3; give the same",
    ):
        load_demonstrations(asked, 1)
    asked.demonstrations.kind = "plain"  # such ones have none to compare, and a file may be of any kind
    assert load_demonstrations(asked, 1).noise == NOISE
    older = write_hdf5(replace(recording, noise=None), tmp_path / "older.hdf5")
    assert len(load_demonstrations(config(older, 0.3), 1)) == 2


def test_a_file_of_another_piece_is_refused_as_the_library_s_own_are(recording, tmp_path):
    here = write_hdf5(recording, tmp_path / "here.hdf5")
    assert load_demonstrations(config(here, NOISE), 1).furniture == furniture_digest("chair_ingolf")
    edited = replace(recording, furniture=furniture_digest("toy_table"))  # stands for an edited one
    with pytest.raises(
        DemonstrationError, match=r"with another chair_ingolf\.yaml than there is now; give the same"
    ):
        load_demonstrations(config(write_hdf5(edited, tmp_path / "edited.hdf5"), NOISE), 1)
    changed(here, lambda file: file["data"].attrs.update({"furniture": 3}))
    with pytest.raises(
        DemonstrationError, match=r"here\.hdf5: attribute furniture of data is .*3.*, should be text"
    ):
        read_demonstrations(here)
