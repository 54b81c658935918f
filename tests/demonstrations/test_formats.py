"""Episodes in other libraries' formats: their readers find what was recorded, and it can be played again to the bit."""

import json
from dataclasses import replace

import gymnasium
import h5py
import mujoco
import numpy as np
import pytest
import torch
from recorded import ARGUMENTS, labelled_script, make, scripted
from tensordict import TensorDict

from tstar_rl.demonstrations.formats import (
    Recording,
    episode_differences,
    not_reproduced,
    read_demonstrations,
    read_hdf5,
    replay_demonstrations,
    write_hdf5,
    write_minari,
)
from tstar_rl.demonstrations.formats.states import StateLayout
from tstar_rl.env.task_tables import furniture_digest

DATASET = "tstar/chair/script-v0"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return labelled_script()


@pytest.fixture(scope="module")
def path(recording, tmp_path_factory):
    return write_hdf5(recording, tmp_path_factory.mktemp("hdf5") / "subtask1.hdf5")


def test_a_state_is_a_row_and_back():
    snapshots = TensorDict(
        {
            "physics": torch.tensor([[0.5, -2.0], [0.1, 3.0]], dtype=torch.float64),
            "task": {"phase": torch.tensor([3, 7]), "half_paid": torch.tensor([True, False])},
        },
        [2],
    )
    layout = StateLayout.from_json(StateLayout.of(snapshots).to_json())
    rows = layout.rows(snapshots)
    assert rows.tolist() == [[0.5, -2.0, 3.0, 1.0], [0.1, 3.0, 7.0, 0.0]]
    back = layout.snapshots(rows)
    assert (back == snapshots).all() and back["task", "phase"].dtype == torch.int64
    with pytest.raises(ValueError, match="a state has 3 numbers, but its layout has 4"):
        layout.snapshots(rows[:, :3])
    with pytest.raises(ValueError, match="phase of a state has type int32; valid: float64, int64, bool"):
        StateLayout.of(TensorDict({"phase": torch.zeros(2, dtype=torch.int32)}, [2]))
    with pytest.raises(ValueError, match="is a list of name, shape and dtype"):
        StateLayout.from_json('[{"name": "physics"}]')


def test_what_is_read_is_what_was_recorded(recording, path):
    back = read_hdf5(path)
    assert back.arguments == recording.arguments and back.made_by == "the script"
    assert back.furniture == recording.furniture == furniture_digest("chair_ingolf")
    for one, other in zip(recording.episodes, back.episodes, strict=True):
        assert episode_differences(one, other) == []
        assert torch.equal(one.labels, other.labels) and one.seed == other.seed


def test_the_same_recording_is_the_same_file(recording, path, tmp_path):
    assert write_hdf5(recording, tmp_path / "again.hdf5").read_bytes() == path.read_bytes()
    assert [file.name for file in tmp_path.iterdir()] == ["again.hdf5"]


def test_a_replay_from_the_file_is_the_episode_to_the_bit(path):
    found = read_hdf5(path)
    env = make(num_envs=1)  # another number of simulations than were recorded
    assert not_reproduced(env, found) == {}
    found.episodes[1].actions[3, 0] += 1e-3
    wrong = not_reproduced(env, found)
    assert list(wrong) == [1]
    assert any(told.startswith("observations differs from step 4 on, by") for told in wrong[1])


def test_failures_and_cut_episodes_are_played_again_too(recording, tmp_path):
    failed = scripted(max_steps=5)
    assert [len(one) for one in failed.episodes] == [5, 5] and failed.successes.episodes == []
    found = read_hdf5(write_hdf5(failed, tmp_path / "failed.hdf5"))
    assert found.episodes[0].truncated.tolist() == [False] * 4 + [True]
    with h5py.File(tmp_path / "failed.hdf5") as file:
        assert file["data/demo_0/dones"][:].tolist() == [0] * 4 + [1]
    assert not_reproduced(make(max_steps=5), found) == {}
    first = recording.episodes[0]
    cut = {
        name: getattr(first, name)[:4]
        for name in ("actions", "rewards", "terminated", "truncated", "success")
    }
    short = replace(first, observations=first.observations[:5], states=first.states[:5], **cut)
    assert not_reproduced(make(), replace(recording, episodes=[first, short])) == {}


def test_the_library_s_own_demonstrations_become_episodes(path):
    demonstrations = read_demonstrations(path, "chair_ingolf", 1)
    found = replay_demonstrations(make(), replace(demonstrations, kind="noisy"))
    for one, other in zip(read_hdf5(path).episodes, found.episodes, strict=True):
        assert episode_differences(one, other) == [] and torch.equal(one.labels, other.labels)
    assert found.made_by == "scripted assembler, noisy demonstrations"


def test_the_structure_is_robomimic_s(recording, path):
    with h5py.File(path) as file:
        data, lengths = file["data"], [len(one) for one in recording.episodes]
        env_args = json.loads(data.attrs["env_args"])
        assert env_args["env_name"] == "tstar/ChairIngolf-v0" and env_args["type"] == 2
        assert env_args["env_kwargs"] == recording.arguments and data.attrs["total"] == sum(lengths)
        assert list(data) == ["demo_0", "demo_1"]
        assert [data[name].attrs["num_samples"] for name in data] == lengths
        demo, episode = data["demo_1"], recording.episodes[1]
        assert np.array_equal(demo["obs/flat"], episode.observations[:-1])
        assert np.array_equal(demo["next_obs/flat"], episode.observations[1:])
        assert np.array_equal(demo["actions"], episode.actions)
        assert np.array_equal(demo["rewards"], episode.rewards)
        assert demo["dones"][:].tolist() == [0] * (lengths[1] - 1) + [1]
        assert demo["states"].shape == (lengths[1], StateLayout.from_json(data.attrs["state_layout"]).size)
        assert list(file["mask/successes"]) == [b"demo_0", b"demo_1"] and not len(file["mask/failures"])


def test_states_and_model_file_are_enough_for_mujoco_alone(path):
    with h5py.File(path) as file:
        demo, layout = file["data/demo_0"], json.loads(file["data"].attrs["state_layout"])
        model = mujoco.MjModel.from_xml_string(demo.attrs["model_file"])
        data = mujoco.MjData(model)
        assert layout[0]["name"] == "physics"
        state = demo["states"][-1, : layout[0]["shape"][0]]
        observation = demo["obs/flat"][-1]
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_forward(model, data)
    parts = data.qpos[9:].reshape(-1, 7)
    assert np.allclose(observation[29:-8].reshape(-1, 7)[:, :3], parts[:, :3], atol=1e-6)
    assert np.allclose(data.site("grip_site").xpos, observation[16:19], atol=1e-6)


def test_robomimic_reads_it(recording, path):
    library = pytest.importorskip("robomimic.utils.dataset")
    pytest.importorskip("robomimic.utils.obs_utils").initialize_obs_utils_with_obs_specs(
        [{"obs": {"low_dim": ["flat"]}}]
    )
    found = library.SequenceDataset(
        hdf5_path=str(path), obs_keys=("flat",), dataset_keys=("actions", "rewards"), seq_length=3,
        filter_by_attribute="successes",
        **({"action_keys": ["actions"], "action_config": {"actions": {"normalization": None}}}
           if "action_keys" in library.SequenceDataset.__init__.__code__.co_varnames else {}),
    )  # fmt: skip
    assert found.n_demos == 2 and len(found) == sum(map(len, recording.episodes))
    item, episode = found[4], recording.episodes[0]
    assert np.array_equal(item["obs"]["flat"], episode.observations[4:7])
    assert np.array_equal(item["next_obs"]["flat"], episode.observations[5:8])
    assert np.array_equal(item["actions"], episode.actions[4:7])


def test_nothing_to_write_is_no_file(recording, tmp_path):
    with pytest.raises(ValueError, match="there is no episode to write"):
        write_hdf5(replace(recording, episodes=[]), tmp_path / "none.hdf5")
    with pytest.raises(ValueError, match="there is no episode to write"):
        write_minari(replace(recording, episodes=[]), DATASET, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_gymnasium_spec_makes_the_environment_of_the_arguments():
    from tstar_rl.env.their_names import gymnasium_id, gymnasium_spec, task_called

    spec = gymnasium_spec({**ARGUMENTS, "velocity_scale": 0.4})
    world = gymnasium.make(spec).unwrapped.world
    assert (world.name, world.subtask, world.settings.velocity_scale) == ("chair_ingolf", 1, 0.4)
    assert "velocity_scale" not in gymnasium.spec(gymnasium_id("chair_ingolf")).kwargs
    names = ("tstar/ChairIngolf-v0", "tstar_envs:tstar/ChairIngolf-v0", "chair_ingolf")
    assert {task_called(name) for name in names} == {"chair_ingolf"}
