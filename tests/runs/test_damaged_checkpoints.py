"""No damaged copy of a checkpoint is loaded; each is refused by the name of its file. The tool counts more of them."""

import collections
import importlib.util
import os
import shutil
from pathlib import Path

import pytest
import torch
from tensordict import NonTensorData, TensorDict

from tstar_rl.runs import checkpoint, files
from tstar_rl.runs.checksums import SEAL, DamagedCheckpointError, seal

spec = importlib.util.spec_from_file_location(
    "damage_checkpoints", Path(__file__).resolve().parents[2] / "tools" / "damage_checkpoints.py"
)
tool = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tool)


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    folder = tmp_path_factory.mktemp("checkpoints")
    for seed, name in enumerate(("whole", "other")):
        tool.small_skill(folder / name, seed)
    return folder / "whole", folder / "other"


def test_a_damaged_copy_is_refused_by_the_name_of_its_file(checkpoints, tmp_path):
    copies = tool.damaged_copies(*checkpoints, 60, tmp_path)
    found = {(kind, name, tool.outcome(copy, name)) for kind, name, copy in copies}
    assert {result for *_, result in found} == {tool.REFUSED}
    of_kinds = collections.Counter(kind for kind, *_ in found)
    assert of_kinds.keys() == set(tool.KINDS) and min(of_kinds.values()) >= 2


def test_what_a_file_system_leaves_in_a_checkpoint_does_no_harm(checkpoints, tmp_path):
    copy = shutil.copytree(checkpoints[0], tmp_path / "copy")
    for name in (".DS_Store", "._manifest.json", ".nfs01"):
        (copy / name).touch()
        (copy / "components" / name).touch()
    assert tool.outcome(copy, SEAL) == tool.LOADED


def test_every_file_of_a_checkpoint_is_guarded(checkpoints, tmp_path):
    whole, _ = checkpoints
    names = [path.relative_to(whole).as_posix() for path in whole.rglob("*") if path.is_file()]
    assert {"manifest.json", "checksums.json", "components/0000-skill/state.tdz"} <= set(names)
    for number, name in enumerate(names):
        copy = tmp_path / str(number)
        shutil.copytree(whole, copy)
        (copy / name).unlink()
        assert tool.outcome(copy, name) == tool.REFUSED, name


def test_the_tool_tells_what_is_loaded(checkpoints):
    assert tool.outcome(checkpoints[0], "manifest.json") == tool.LOADED


def test_a_message_counts_the_files_that_it_does_not_name(checkpoints, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(checkpoints[0], copy)
    for number in range(5):
        (copy / f"extra{number}").write_text("")
    with pytest.raises(
        DamagedCheckpointError, match=r"extra0 is not in checksums.json; .* and 2 more\. Put it back"
    ):
        tool.Skill.load(copy)


def test_a_checkpoint_that_is_replaced_while_it_is_read_is_refused(tmp_path):
    class Slow(torch.nn.Linear):
        def load_state_dict(self, *arguments, **options):
            checkpoint.save(tmp_path / "best", {"module": torch.nn.Linear(1, 1)}, {})
            return super().load_state_dict(*arguments, **options)

    checkpoint.save(tmp_path / "best", {"module": torch.nn.Linear(1, 1)}, {})
    with pytest.raises(DamagedCheckpointError, match="was replaced while it was read"):
        checkpoint.load(tmp_path / "best", {"module": Slow(1, 1)})


def test_what_a_killed_process_left_is_removed_by_the_next_save(tmp_path):
    module = torch.nn.Linear(1, 1)
    left = [
        f".{name}.{kind}-{'0' * 32}"
        for name in ("best", "checkpoint-000000000001")
        for kind in ("new", "old")
    ]
    other = f".best_of_all.new-{'0' * 32}"
    for name in (*left, other):
        (tmp_path / name).mkdir()
    checkpoint.save(tmp_path / "best", {"module": module}, {})
    checkpoint.save_step(tmp_path, 2, {"module": module}, {})
    assert sorted(path.name for path in tmp_path.iterdir()) == [other, "best", "checkpoint-000000000002"]


def test_a_place_is_taken_as_it_is_written_also_where_it_looks_like_the_home_folder(tmp_path, monkeypatch):
    """A shell has put the home folder in the place of a ~ before; one in quotes is a name like any other."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    module = torch.nn.Linear(1, 1)
    checkpoint.save(Path("~/last"), {"module": module}, {"a": 1})
    checkpoint.save_step(Path("~/steps"), 7, {"module": module}, {"a": 2})
    newest = checkpoint.latest(Path("~/steps"))
    for place, record in ((Path("~/last"), {"a": 1}), (newest, {"a": 2})):
        loaded = torch.nn.Linear(1, 1)
        assert checkpoint.load(place, {"module": loaded}) == record
        assert torch.equal(loaded.weight, module.weight)
    assert not (tmp_path / "home").exists()


def test_a_checkpoint_is_on_the_disk_before_the_one_before_it_goes(tmp_path, monkeypatch):
    done: list[tuple[str, Path]] = []
    real = {"fsync": os.fsync, "replace": os.replace}

    def fsync(handle: int) -> None:
        done.append(("written", Path(os.readlink(f"/proc/self/fd/{handle}"))))
        real["fsync"](handle)

    def replace(source, destination) -> None:
        done.append(("placed", Path(source)))
        real["replace"](source, destination)

    checkpoint.save_step(tmp_path, 1, {"module": torch.nn.Linear(1, 1)}, {})
    monkeypatch.setattr(files.os, "fsync", fsync)
    monkeypatch.setattr(files.os, "replace", replace)
    checkpoint.save_step(tmp_path, 2, {"module": torch.nn.Linear(1, 1)}, {})
    (newest,) = tmp_path.glob("checkpoint-*")
    (stage,) = (
        path for what, path in done if what == "placed" and path.name.startswith(f".{newest.name}.new-")
    )
    written = [path for what, path in done[: done.index(("placed", stage))] if what == "written"]
    made = {stage, *(stage / path.relative_to(newest) for path in newest.rglob("*"))}
    assert len(made) > 4 and made <= set(written)
    assert ("written", tmp_path) in done[done.index(("placed", stage)) :]


class Harmful:
    """What runs code when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_a_pickle_in_a_checkpoint_is_not_read(tmp_path):
    """Whoever makes one can seal it."""
    folder, mark = tmp_path / "mine", tmp_path / "mark"
    checkpoint.save(folder, {"module": torch.nn.Linear(1, 1)}, {})
    archive = folder / "components/0000-module/state.tdz"
    archive.unlink()
    TensorDict({"harm": NonTensorData(Harmful(mark))}).save(archive, archive=True)
    mark.unlink(missing_ok=True)  # it was copied while it was saved, which makes one anew
    (folder / SEAL).unlink()
    seal(folder)
    with pytest.raises(DamagedCheckpointError, match="mine holds pickled data, which could run any code"):
        checkpoint.load(folder, {"module": torch.nn.Linear(1, 1)})
    assert not mark.exists()
