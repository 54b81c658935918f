"""No damaged copy of a checkpoint is loaded; each is refused by the name of its file. The tool counts more of them."""

import collections
import importlib.util
import shutil
from pathlib import Path

import pytest
import torch

from tstar_rl.runs import checkpoint
from tstar_rl.runs.checksums import DamagedCheckpointError

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
