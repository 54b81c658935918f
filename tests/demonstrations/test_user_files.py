"""A user's own HDF5 file is learned from; one that is wrong anywhere is refused by file, demonstration and key."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from recorded import WIDTH, changed, env_args, leave_two_of_anybody, put, scripted

from tstar_rl.demonstrations.file_check import DemonstrationError
from tstar_rl.demonstrations.formats import (
    Recording,
    episode_differences,
    read_demonstrations,
    read_hdf5,
    replay_demonstrations,
    write_hdf5,
)


@pytest.fixture
def path(tmp_path) -> Path:
    return leave_two_of_anybody(tmp_path / "mine.hdf5")


@pytest.fixture(scope="module")
def recorded() -> Recording:
    return scripted(max_steps=3)


def test_observations_and_actions_are_enough(path):
    found = read_demonstrations(path, "chair_ingolf", 1)
    assert (found.task, found.subtask, found.kind, len(found)) == ("chair_ingolf", 1, "imported", 2)
    assert found.lengths.tolist() == [2, 3]  # by their numbers, not as text
    assert found.arguments == {"task": "chair_ingolf", "subtask": 1, "velocity_scale": 0.5}
    with h5py.File(path) as file:
        actions = np.concatenate([file["data/demo_2/actions"], file["data/demo_10/actions"]])
        observations = np.concatenate([file["data/demo_2/obs/flat"], file["data/demo_10/obs/flat"]])
    assert torch.equal(found.actions, torch.from_numpy(actions).float())
    assert torch.equal(found.executed, found.actions) and found.actions.dtype == torch.float32
    assert torch.equal(found.observations, torch.from_numpy(observations).float())
    assert found.snapshots.is_empty() and found.snapshots.batch_size == (5,)
    with pytest.raises(ValueError, match="demonstrations of kind imported are not saved"):
        found.save(path.with_suffix(".npz"))
    with pytest.raises(ValueError, match="demonstrations of a file have no full states: they cannot"):
        replay_demonstrations(None, found)


def test_expert_actions_are_what_is_imitated(path):
    labels = np.full((2, 9), 0.25)
    found = read_demonstrations(changed(path, put("data/demo_2/expert_actions", labels)))
    assert (found.actions[:2] == 0.25).all() and not (found.executed[:2] == 0.25).any()
    assert torch.equal(found.actions[2:], found.executed[2:])


def test_another_key_of_observations_and_some_of_the_demonstrations(path):
    def rename(file):
        for demo in file["data"].values():
            demo.move("obs/flat", "obs/state")
        file["mask/train"] = np.array(["demo_10"], dtype="S")

    changed(path, rename)
    found = read_demonstrations(path, observation_key="state", filter_key="train")
    assert found.lengths.tolist() == [3]
    with pytest.raises(
        DemonstrationError, match=r"demo_2 has no obs/flat .*observation_key.*; obs has state"
    ):
        read_demonstrations(path)
    with pytest.raises(DemonstrationError, match="mask has no valid; it has train"):
        read_demonstrations(path, observation_key="state", filter_key="valid")


def test_only_successes_are_learned_from(recorded, tmp_path):
    path = write_hdf5(recorded, tmp_path / "failed.hdf5")
    with pytest.raises(
        DemonstrationError, match=r"demo_0 did not succeed; .*filter_key=successes leaves out"
    ):
        read_demonstrations(path)
    with pytest.raises(DemonstrationError, match="there is no demonstration"):
        read_demonstrations(path, filter_key="successes")
    changed(path, lambda file: file["data/demo_1"].attrs.modify("success", True))
    changed(path, put("mask/successes", np.array(["demo_1"], dtype="S")))
    found = read_demonstrations(path, filter_key="successes")
    assert torch.equal(found.observations, recorded.episodes[1].observations[:-1])
    assert (found.snapshots == recorded.episodes[1].states[:-1]).all()


LONG, FLAT = "data/demo_10/actions", "data/demo_10/obs/flat"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (LONG, None, "demo_10 has no actions; it has obs"),
        (LONG, np.zeros((3, 8)), r"demo_10/actions has shape \(3, 8\), should be \(3, 9\): 7 joint velocities, grip"),
        (LONG, np.zeros((0, 9)), "demo_10 has 0 actions, and num_samples is 0"),
        (LONG, np.zeros(()), "demo_10 has 0 actions"),
        (LONG, np.full((3, 9), np.nan), "demo_10/actions has values that are not finite, first in row 0"),
        (LONG, np.array([[0.0] * 9, [1.5] * 9, [0.0] * 9]), r"demo_10/actions has 1\.5 in row 1; .* in \[-1, 1\]"),
        (LONG, np.array([["a"] * 9] * 3, dtype="S"), r"demo_10/actions has type \|S1, should be numbers"),
        (f"{LONG}/x", np.zeros(3), "demo_10/actions is a group, should be an array"),
        (FLAT, None, r"demo_10 has no obs/flat .*it has actions, obs; obs has nothing"),
        (FLAT, np.zeros((3, 65)), r"demo_10/obs/flat has shape \(3, 65\), should be \(3, 72\): 29 for the robot"),
        (FLAT, np.zeros((2, WIDTH)), r"demo_10/obs/flat has shape \(2, 72\), should be \(3, 72\)"),
        (FLAT, np.full((3, WIDTH), 1e300), "demo_10/obs/flat has values that are not finite"),
        ("data/demo_10/expert_actions", np.full((3, 9), -2), "demo_10/expert_actions has -2 in row 0"),
        ("data/demo_10/states", np.zeros((2, 5)), r"demo_10/states has shape \(2, 5\), should be \(3, 5\)"),
        ("data/demo_10/rewards", np.zeros((3, 1)), r"demo_10/rewards has shape \(3, 1\), should be \(3,\)"),
        ("data/episode_1/actions", np.zeros((3, 9)), "data has episode_1; demonstrations are called demo_0, demo_1"),
        ("data", None, "group data is missing; the file has nothing"),
        ("data", np.zeros(3), "group data is missing; the file has data"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(path, name, value, message):
    changed(path, put(name.removesuffix("/x"), None))
    with pytest.raises(DemonstrationError, match=rf"mine\.hdf5: .*{message}"):
        read_demonstrations(changed(path, put(name, value)))


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (None, "is missing or not what it should be, which is JSON such as"),
        ("{", "is missing or not what it should be"),
        ("[1]", "is missing or not what it should be"),
        ('{"env_kwargs": {"subtask": 0}}', "is missing or not what it should be"),
        (env_args("tstar/ChairIngolv-v0"), "no furniture is called 'tstar/ChairIngolv-v0'.* valid: "),
        (env_args(subtask=1, task="chair_ingolv"), "did you mean 'chair_ingolf'"),
        (env_args(subtask=6), r"subtask of chair_ingolf must be in 0\.\.\d, got 6"),
        (env_args(subtask="1"), "has subtask '1', should be null"),
        (
            env_args(subtask=1, velocity_scal=0.5),
            r"has env_kwargs 'velocity_scal'; valid .*; did you mean velocity_scale",
        ),
        (env_args(subtask=0), "is of chair_ingolf, subtask 0; wanted chair_ingolf, subtask 1"),
        (env_args(), "is of chair_ingolf, the whole task; wanted chair_ingolf, subtask 1"),
        (
            env_args("tstar/ChairBernhard-v0", subtask=1),
            r"demo_2/obs/flat has shape \(2, 72\), should be \(2, 58\)",
        ),
    ],
)
def test_an_environment_that_is_not_there_is_named(path, said, message):
    def change(file):
        del file["data"].attrs["env_args"]
        if said is not None:
            file["data"].attrs["env_args"] = said

    with pytest.raises(DemonstrationError, match=rf"mine\.hdf5: .*{message}"):
        read_demonstrations(changed(path, change), "chair_ingolf", 1)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("success", "False", "has attribute success 'False', should be true or false"),
        ("success", 2, "has attribute success 2, should be true or false"),
        ("success", 0.5, r"has attribute success 0\.5, should be true or false"),
        ("success", np.array([True]), r"has attribute success array\(\[ True\]\), should be"),
        ("success", 0, "did not succeed; leave it out of the file, or name a list below mask"),
        ("num_samples", 2.5, r"has attribute num_samples 2\.5, should be a whole number"),
        ("num_samples", "2", "has attribute num_samples '2', should be a whole number"),
        ("seed", float("nan"), "has attribute seed nan, should be a whole number"),
        ("seed", 1e308, r"has attribute seed 1e\+308, should be a whole number of 64 bits"),
    ],
)
def test_attributes_of_a_demonstration_are_read_strictly(path, name, value, message):
    changed(path, lambda file: file["data/demo_2"].attrs.update({name: value}))
    with pytest.raises(DemonstrationError, match=rf"mine\.hdf5: demo_2 .*{message}"):
        read_demonstrations(path)


def test_what_gymnasium_adds_to_the_settings_is_no_setting(path):
    said = env_args(subtask=1, velocity_scale=0.5, reward_scale=0.05, render_mode=None, num_envs=4)
    changed(path, lambda file: file["data"].attrs.update({"env_args": said}))
    assert read_demonstrations(path).arguments == {
        "task": "chair_ingolf",
        "subtask": 1,
        "velocity_scale": 0.5,
    }


def test_a_file_that_cannot_be_played_again_says_so(path, recorded, tmp_path):
    with pytest.raises(DemonstrationError, match="demo_2 has no next_observations, so it cannot be played"):
        read_hdf5(path)
    whole = write_hdf5(recorded, tmp_path / "whole.hdf5")
    changed(whole, lambda file: file["data"].attrs.modify("state_layout", '[{"name": "x"}]'))
    with pytest.raises(
        DemonstrationError, match="attribute state_layout of data: a layout of states is a list"
    ):
        read_hdf5(whole)
    with pytest.raises(FileNotFoundError, match="no demonstrations at .*none.hdf5"):
        read_hdf5(tmp_path / "none.hdf5")


@pytest.mark.parametrize(
    ("was", "now", "differing"),
    [
        (b'"task/phase"', b'"task/fase"', "task/fase, task/phase"),
        (b'"task/phase", "shape": [], "dtype": "int64"', b'"task/phase", "shape": [], "dtype": "bool"', "task/phase"),
        (b'"task/success", "shape": [], "dtype": "bool"', b'"task/success", "shape": [], "dtype": "int64"',
         "task/success"),
    ],
)  # fmt: skip
def test_states_of_another_layout_are_refused(recorded, tmp_path, was, now, differing):
    path = write_hdf5(recorded, tmp_path / "whole.hdf5")

    def rename(file) -> None:
        layout = file["data"].attrs["state_layout"]
        assert was in layout
        file["data"].attrs["state_layout"] = layout.replace(was, now)
        for demo in file["data"].values():
            demo.attrs["success"] = True

    with pytest.raises(DemonstrationError, match=f"not that of a state of .*it differs in {differing}$"):
        read_demonstrations(changed(path, rename))


def test_a_damaged_or_short_file_is_refused_by_its_name(recorded, tmp_path):
    """One byte flipped at a time: none passes as other demonstrations, and none raises an error of HDF5's own."""
    path = write_hdf5(recorded, tmp_path / "whole.hdf5")
    good, whole, refused = read_hdf5(path), path.read_bytes(), 0
    places = range(0, len(whole), len(whole) // 60)
    contents = [whole[:at] + bytes([whole[at] ^ 0x5A]) + whole[at + 1 :] for at in places]
    for content in [*contents, b"", whole[:100], whole[: len(whole) // 2], whole[:-1]]:
        path.write_bytes(content)
        try:
            found = read_hdf5(path)
        except DemonstrationError as error:
            assert str(path) in str(error)
            refused += 1
        else:
            assert len(content) == len(whole) and found.arguments == good.arguments
            for one, other in zip(good.episodes, found.episodes, strict=True):
                assert episode_differences(one, other) == [] and one.seed == other.seed
    assert refused > len(places) / 3
