"""Episodes as a Minari data set: Minari's reader finds what was recorded, and it can be played again to the bit."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from recorded import labelled_script, scripted

from tstar_rl import checks
from tstar_rl.checks import MissingExtraError
from tstar_rl.demonstrations.formats import Recording, write_minari
from tstar_rl.demonstrations.formats.states import StateLayout

DATASET = "tstar/chair/script-v0"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return labelled_script()


@pytest.fixture(scope="module")
def minari_root(recording, tmp_path_factory):
    root = tmp_path_factory.mktemp("minari")
    write_minari(recording, DATASET, root)
    return root


@pytest.fixture
def dataset(minari_root, monkeypatch):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(minari_root))
    return minari.load_dataset(DATASET)


def test_minari_reads_it(recording, dataset):
    assert dataset.total_episodes == 2 and dataset.total_steps == sum(map(len, recording.episodes))
    for one, other in zip(recording.episodes, dataset.iterate_episodes(), strict=True):
        assert np.array_equal(one.observations, other.observations)
        assert np.array_equal(one.actions, other.actions) and np.array_equal(one.rewards, other.rewards)
        assert np.array_equal(one.terminated, other.terminations)
        assert np.array_equal(one.truncated, other.truncations)
        assert np.array_equal(other.infos["success"][1:], one.success)
        assert np.array_equal(other.infos["expert_action"][:-1], one.labels)
    assert dataset.storage.metadata["model_xml"].startswith("<mujoco")


def test_minari_reads_that_the_time_limit_cut_an_episode(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    write_minari(scripted(max_steps=5), "tstar/cut-v0", tmp_path)
    episode = minari.load_dataset("tstar/cut-v0")[0]
    assert episode.truncations.tolist() == [False] * 4 + [True] and not episode.terminations.any()


def test_its_own_environment_replays_a_minari_episode_to_the_bit(dataset):
    env, episode = dataset.recover_environment(), dataset[1]
    assert env.observation_space == dataset.observation_space and env.unwrapped.world.subtask == 1
    layout = StateLayout.from_json(dataset.storage.metadata["state_layout"])
    start = layout.snapshots(torch.from_numpy(episode.infos["state"][:1]))
    observation, _ = env.reset(options={"snapshot": start})
    assert np.array_equal(observation, episode.observations[0])
    for t, action in enumerate(episode.actions):
        observation, reward, terminated, truncated, info = env.step(action)
        assert np.array_equal(observation, episode.observations[t + 1])
        assert np.float32(reward) == episode.rewards[t]
        assert (terminated, truncated) == (episode.terminations[t], episode.truncations[t])
    assert terminated and info["success"]


def test_a_minari_data_set_is_replaced_as_a_whole(recording, minari_root, dataset):
    import minari

    one = replace(recording, episodes=recording.episodes[:1])
    other = "tstar/chair/other-v0"
    for episodes in (recording, one):
        write_minari(episodes, other, minari_root)
    assert minari.load_dataset(other).total_episodes == 1 and minari.load_dataset(DATASET).total_episodes == 2
    assert set(minari.list_local_datasets()) == {DATASET, other}
    assert sorted(file.name for file in minari_root.iterdir()) == ["tstar"]
    with pytest.raises(ValueError, match=r"'a b' is no id of a Minari data set: write namespace/name-v0"):
        write_minari(one, "a b", minari_root)


def test_a_minari_data_set_that_a_kill_left_aside_is_put_back_also_if_the_new_one_fails(
    recording, tmp_path, monkeypatch
):
    there = write_minari(recording, DATASET, tmp_path)
    files = sorted(file.relative_to(there) for file in there.rglob("*"))
    there.rename(there.with_name(f".{there.name}.old-0"))

    def fail(*arguments):
        raise OSError("no space")

    monkeypatch.setattr("tstar_rl.demonstrations.formats.minari_write._create", fail)
    with pytest.raises(OSError, match="no space"):
        write_minari(recording, DATASET, tmp_path)
    assert sorted(file.relative_to(there) for file in there.rglob("*")) == files
    assert [file.name for file in there.parent.iterdir() if file.name.startswith(".")] == []


def test_what_a_kill_left_of_a_data_set_is_removed_and_nothing_of_others(recording, tmp_path):
    there = write_minari(recording, DATASET, tmp_path)
    left = [there.with_name(f".{there.name}.old-{'0' * 32}"), tmp_path / ".writing-tstar_chair_script-v0-x"]
    others = [tmp_path / ".writing-tstar_chair_other-v0-x"]
    for folder in (*left, *others):
        folder.mkdir()
    write_minari(recording, DATASET, tmp_path)
    assert not any(folder.exists() for folder in left) and all(folder.is_dir() for folder in others)


@pytest.mark.parametrize("missing", ["h5py", "minari"])
def test_a_library_that_is_not_installed_is_named(recording, tmp_path, monkeypatch, missing):
    def without(name):
        if name == missing:
            raise ModuleNotFoundError(name=name)
        return __import__(name)

    monkeypatch.setattr(checks, "import_module", without)
    with pytest.raises(MissingExtraError, match=rf"needs {missing}, which is not installed: .*\[export\]"):
        write_minari(recording, DATASET, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ImportError("undefined symbol"), "needs h5py, which is installed, and fails: undefined symbol"),
        (ModuleNotFoundError(name="mpi4py"), "needs h5py, which is installed, but not mpi4py"),
    ],
)
def test_a_library_that_is_installed_and_does_not_work_is_not_called_missing(monkeypatch, error, said):
    def fails(name):
        raise error

    monkeypatch.setattr(checks, "import_module", fails)
    with pytest.raises(MissingExtraError, match=said):
        checks.import_extra("h5py", "export", "a file of HDF5")
