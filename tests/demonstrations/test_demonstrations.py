"""Demonstrations come back as written, and a damaged file names what is wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from recorded import made_up
from tensordict import TensorDict

from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.file_check import DemonstrationError


@pytest.fixture
def demonstrations() -> Demonstrations:
    return made_up()


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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: {"actions": torch.nan * d.actions}, "field actions has values that are not finite"),
        (lambda d: {"actions": d.actions[:-1]}, r"field actions has shape \(6, 9\), should be \(7, 9\)"),
        (
            lambda d: {"observations": d.observations[:, :10]},
            r"field observations has shape \(7, 10\), should be",
        ),
        (lambda d: {"snapshots": TensorDict({}, [7])}, "field snapshot/.* is missing"),
        (lambda d: {"success": ~d.success}, "field success is False in episode 0"),
        (lambda d: {"subtask": -1}, "field subtask is -1, should be null"),
        (
            lambda d: {"arguments": {**d.arguments, "snapp": True}},
            "field arguments has 'snapp'; valid settings",
        ),
        (
            lambda d: {"arguments": {**d.arguments, "task": "toy_table"}},
            "field arguments.task is 'toy_table'",
        ),
    ],
)
def test_what_could_not_be_read_again_is_not_written(demonstrations, tmp_path, change, message):
    with pytest.raises(DemonstrationError, match=message):
        replace(demonstrations, **change(demonstrations)).save(tmp_path / "some.npz")
    assert not list(tmp_path.iterdir())


def test_some_of_them_and_others(demonstrations):
    one = demonstrations.first(1)
    assert len(one) == 1 and one.lengths.tolist() == [3]
    assert torch.equal(one.observations, demonstrations.observations[:3])
    assert one.snapshots["task", "phase"].tolist() == [0, 1, 2]
    both = one.and_also(demonstrations)
    assert len(both) == 3 and both.lengths.tolist() == [3, 3, 4] and both.kind == "noisy"
    for name in ("observations", "actions", "executed"):
        mine = getattr(demonstrations, name)
        assert torch.equal(getattr(both, name), torch.cat([mine[:3], mine]))
    assert both.snapshots["task", "phase"].tolist() == [0, 1, 2, 0, 1, 2, 3, 4, 5, 6]
    bare = replace(one, snapshots=TensorDict({}, [3])).and_also(demonstrations)
    assert bare.snapshots.is_empty() and bare.snapshots.batch_size == (10,)


def test_a_truncated_file(path):
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(DemonstrationError, match=r"some\.npz cannot be read"):
        Demonstrations.load(path)


def test_another_task(path):
    with pytest.raises(
        DemonstrationError, match="field task, subtask is table_lack, 2; wanted table_lack, 0"
    ):
        Demonstrations.load(path, "table_lack", 0)
    with pytest.raises(DemonstrationError, match="is table_lack, 2; wanted table_lack, None"):
        Demonstrations.load(path, "table_lack")  # the whole task
    assert Demonstrations.load(path).subtask == 2


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="make_demonstrations"):
        Demonstrations.load(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("actions", None, "field actions is missing"),
        ("observations", np.zeros((7, 71), np.float32), r"field observations has shape \(7, 71\)"),
        ("executed", np.full((7, 9), np.nan, np.float32), "field executed has values that are not finite"),
        (
            "observations",
            np.zeros((7, 65), np.float32),
            r"\(7, 65\), should be \(7, 72\): 72 numbers in an obs",
        ),
        ("observations", np.zeros(7, np.float32), r"field observations has shape \(7,\)"),
        ("actions", np.full((7, 9), 1.5, np.float32), r"field actions has 1\.5; actions are in \[-1, 1\]"),
        ("executed", np.full((7, 9), -2, np.float32), r"field executed has 2; actions are in \[-1, 1\]"),
        ("lengths", np.array([3, 5]), r"should be \(8, 72\)"),
        ("lengths", np.array([7, 0]), "field lengths must be positive numbers"),
        ("success", np.array([True, False]), "field success is False in episode 1; all must be successes"),
        ("success", np.array([1, 1]), "field success has type int64, should be bool"),
        ("seeds", np.array([1.0, 2.0]), "field seeds has type float64"),
        (
            "snapshot/physics",
            np.zeros((6, 277)),
            r"field snapshot/physics has shape \(6, 277\), should be \(7, 277\)",
        ),
        (
            "snapshot/physics",
            np.zeros((7, 3)),
            r"field snapshot/physics has shape \(7, 3\), should be \(7, 277\)",
        ),
        ("snapshot/welds", np.zeros((7, 3, 12)), r"field snapshot/welds has shape \(7, 3, 12\), should be"),
        ("snapshot/task/potential", None, "field snapshot/task/potential is missing"),
        ("snapshot/task/mood", np.zeros(7), "field snapshot/task/mood is unknown; valid: snapshot/physics, "),
        ("noise", np.array(-0.1), r"field noise is array\(-0\.1\), should be one float64 from 0"),
        ("furniture", np.array("table"), "field furniture is .*table.*, should be 64 hexadecimal digits"),
        (
            "snapshot/physics",
            np.full((7, 277), np.nan),
            "field snapshot/physics has values that are not finite",
        ),
        ("snapshot/physics", np.array(["a"] * 7), "field snapshot/physics has type <U1, should be float64"),
        (
            "snapshot/physics",
            np.zeros((7, 277), np.float32),
            "field snapshot/physics has type float32, should be float64",
        ),
        ("snapshot/task/phase", np.zeros(7), "field snapshot/task/phase has type float64, should be int64"),
        (
            "snapshot/task/success",
            np.zeros(7, int),
            "field snapshot/task/success has type int64, should be bool",
        ),
        ("snapshot/task/phase", np.zeros((), int), r"field snapshot/task/phase has shape \(\)"),
        ("snapshot/welds", None, "field snapshot/welds is missing"),
        ("header", None, "field header is missing or not JSON"),
        ("header", np.array("{}"), "field format_version is missing"),
        ("header", np.array("not json"), "field header is missing or not JSON"),
        ("header", np.array("3"), "field header is 3, should be a mapping of task, subtask, kind, arguments"),
        ("header", np.array(3), "field header is 3, should be a mapping"),
        ("header", np.array([1, 2]), "field header is missing or not JSON"),
    ],
)
def test_what_is_wrong_is_named(path, name, value, message):
    arrays = contents(path)
    arrays[name] = value
    np.savez(path, **{key: array for key, array in arrays.items() if array is not None})
    with pytest.raises(DemonstrationError, match=rf"some\.npz: .*{message}"):
        Demonstrations.load(path)


def contents(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as file:
        return {key: file[key] for key in file.files}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"arguments": 3}, "field arguments is 3, should be a mapping of the environment's settings"),
        ({"arguments": {"task": "chair"}}, "arguments.task is 'chair', but field task is 'table_lack'"),
        ({"arguments": {"subtask": None}}, "arguments.subtask is None, but field subtask is 2"),
        (
            {"author": "me", "age": 3},
            "field header has age, author; valid: format_version, task, subtask, kind",
        ),
        (
            {"arguments": {"snapp": True}},
            r"field arguments has 'snapp'; valid settings: .*; did you mean snap",
        ),
        (
            {"task": "table_lac", "arguments": {}},
            "field task: no furniture is called 'table_lac': did you mean 'table_lack'",
        ),
        ({"task": 3}, "field task is 3, should be the name of a piece of furniture"),
        ({"subtask": -1}, r"field subtask is -1, should be null \(all\) or 0, 1"),
        ({"subtask": "2"}, "field subtask is '2'"),
        ({"kind": ["plain"]}, r"field kind is \['plain'\]; valid: plain, noisy"),
        ({"format_version": 2, "new": 1}, "field format_version is 2; this code reads 1"),
    ],
)
def test_what_is_wrong_in_the_header_is_named(path, changed, message):
    arrays = contents(path)
    arrays["header"] = np.array(json.dumps(json.loads(str(arrays["header"])) | changed))
    np.savez(path, **arrays)
    with pytest.raises(DemonstrationError, match=rf"some\.npz: .*{message}"):
        Demonstrations.load(path)


def test_a_single_array_is_not_a_file_of_demonstrations(tmp_path):
    with (tmp_path / "some.npz").open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(DemonstrationError, match=r"some\.npz cannot be read \(truncated or not \.npz"):
        Demonstrations.load(tmp_path / "some.npz")


def test_damaged_bytes_name_the_field_or_are_found_in_the_values(path):
    """One byte flipped at a time: none passes as other demonstrations, and none raises an error of zip or NumPy."""
    whole, arrays, named = path.read_bytes(), contents(path), 0
    for place in range(0, len(whole), 41):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x5A]) + whole[place + 1 :])
        try:
            Demonstrations.load(path)
        except DemonstrationError as error:
            assert str(path) in str(error)
            named += "field actions cannot be read" in str(error)
        else:  # bytes that mean nothing: dates of the archive's members
            assert all(np.array_equal(contents(path)[name], array) for name, array in arrays.items())
    assert named


def test_an_entry_that_hides_the_next_one_is_not_a_shorter_file(path):
    """The last but one says that a comment follows it, longer than the last: zipfile would leave that array out."""
    whole = path.read_bytes()
    last = whole.rindex(b"PK\1\2")
    comment_length = whole.rindex(b"PK\1\2", 0, last) + 32
    path.write_bytes(whole[:comment_length] + b"\x5a" + whole[comment_length + 1 :])
    with pytest.raises(
        DemonstrationError, match=r"some\.npz.*end says that it has 25 arrays, its list has 24"
    ):
        Demonstrations.load(path)
