"""Demonstrations come back as written, and a damaged file names what is wrong."""

from pathlib import Path

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf
from tensordict import TensorDict

from tstar_rl.configuration import load_demonstrations
from tstar_rl.demonstrations import DemonstrationError, Demonstrations


@pytest.fixture
def demonstrations() -> Demonstrations:
    rows = 7
    snapshots = {"physics": torch.randn(rows, 3, dtype=torch.float64), "task": {"phase": torch.arange(rows)}}
    return Demonstrations(
        task="table_lack",
        subtask=2,
        kind="noisy",
        arguments={"task": "table_lack", "velocity_scale": 0.4},
        seeds=torch.tensor([5, 5]),
        lengths=torch.tensor([3, 4]),
        observations=torch.randn(rows, 72),
        actions=torch.randn(rows, 9),
        executed=torch.randn(rows, 9),
        success=torch.ones(2, dtype=torch.bool),
        snapshots=TensorDict.from_dict(snapshots, batch_size=[rows]),
    )


@pytest.fixture
def path(demonstrations, tmp_path) -> Path:
    demonstrations.save(tmp_path / "some.npz")
    return tmp_path / "some.npz"


def test_they_come_back(demonstrations, path):
    back = Demonstrations.load(path, "table_lack", 2)
    assert back.kind == "noisy" and back.arguments == demonstrations.arguments and len(back) == 2
    for name in ("observations", "actions", "executed", "lengths", "seeds", "success"):
        assert torch.equal(getattr(back, name), getattr(demonstrations, name))
    assert (back.snapshots == demonstrations.snapshots).all()
    assert [file.name for file in path.parent.iterdir()] == ["some.npz"]


def test_those_of_another_world_are_refused_unless_they_may_differ(demonstrations, tmp_path):
    place = tmp_path / "table_lack" / "subtask2_noisy.npz"
    config = {"task": {"name": "table_lack"}, "demonstrations_dir": str(tmp_path), "device": "cpu"}
    config |= {
        "demonstrations": {"kind": "noisy", "may_differ": []},
        "env": {"velocity_scale": 0.4, "snap": True},
    }
    config = OmegaConf.create(config)
    demonstrations.arguments["snap"] = False
    demonstrations.save(place)
    with pytest.raises(DemonstrationError, match="snap was False when it was saved, and is True now"):
        load_demonstrations(config, 2)
    config.demonstrations.may_differ = ["snap"]
    assert len(load_demonstrations(config, 2)) == 2
    config.env.skipped_phases = "paid"  # older than the setting: they were made with its default
    assert len(load_demonstrations(config, 2)) == 2
    config.env.skipped_phases = "unpaid"
    with pytest.raises(DemonstrationError, match="skipped_phases was 'paid' when it was saved"):
        load_demonstrations(config, 2)
    config.demonstrations.may_differ = ["snap", "skipped_phases"]
    config.env.velocity_scale = 1.0
    with pytest.raises(DemonstrationError, match=r"velocity_scale was 0\.4"):
        load_demonstrations(config, 2)


def test_a_truncated_file(path):
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(DemonstrationError, match=r"some\.npz cannot be read"):
        Demonstrations.load(path)


def test_another_task(path):
    with pytest.raises(
        DemonstrationError, match="field task, subtask is table_lack, 2; wanted table_lack, 0"
    ):
        Demonstrations.load(path, "table_lack", 0)


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="make_demonstrations"):
        Demonstrations.load(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("actions", None, "field actions is missing"),
        ("observations", np.zeros((7, 71), np.float32), r"field observations has shape \(7, 71\)"),
        ("executed", np.full((7, 9), np.nan, np.float32), "field executed has values that are not finite"),
        ("lengths", np.array([3, 5]), r"should be \(8, 72\)"),
        ("seeds", np.array([1.0, 2.0]), "field seeds has type float64"),
        ("snapshot/physics", np.zeros((6, 3)), "field snapshot/physics"),
        ("header", np.array("{}"), "field format_version is missing"),
        ("header", np.array("not json"), "field header"),
    ],
)
def test_what_is_wrong_is_named(path, name, value, message):
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files}
    arrays[name] = value
    np.savez(path, **{key: array for key, array in arrays.items() if array is not None})
    with pytest.raises(DemonstrationError, match=message):
        Demonstrations.load(path)
