"""Skills one after another: the policy that runs them, and the folder that they are kept in."""

import re
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import nn

from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.runs.checkpoint import check_place, is_checkpoint, read_record
from tstar_rl.runs.checksums import DamagedCheckpointError
from tstar_rl.runs.files import replacing_folder
from tstar_rl.runs.run_folder import made_by
from tstar_rl.runs.saved_kinds import kind_of

__all__ = ["ChainPolicy", "chain_folders", "chain_record", "check_order", "load_chain", "save_chain"]


class ChainPolicy(TensorDictModuleBase):
    """Map from "observation", "subtask" to "action": each row acts with the policy of its own subtask.

    Rows past the last subtask (the task is done) act with the last skill. Sampling follows TorchRL's
    `set_exploration_type`, as each skill's own policy does.

    Args:
        skills: in the order of the subtasks. Each one's networks share a normaliser, so move the skills to a device
            (`Skill.to`), not this policy of theirs.

    Raises:
        InvalidValueError: if there are none, one stands in another's place, or they are of several tasks.
    """

    def __init__(self, skills: Sequence[Skill]) -> None:
        super().__init__()
        alone = isinstance(skills, (str, Path, Skill, nn.Module))
        if alone or not all(isinstance(skill, Skill) for skill in skills):
            path = isinstance(skills, (str, Path))
            got = (
                repr(skills)
                if path
                else ", ".join(type(each).__name__ for each in ([skills] if alone else skills))
            )
            raise InvalidValueError(f"a chain is made of skills, as load_chain(path) gives them; got {got}")
        check_order(skills)
        self.in_keys, self.out_keys = ["observation", "subtask"], ["action"]
        self.policies = nn.ModuleList(skill.policy for skill in skills)
        self._piece, self._width = skills[0].task, skills[0].obs_dim

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: any batch size -> the same with "action" (*batch, 9).

        Raises:
            ValueError: if it is no TensorDict, or its observations are of another piece, as far as their width tells.
        """
        if not isinstance(tensordict, TensorDictBase):
            raise InvalidValueError(
                'a chain acts on a TensorDict with "observation" (*batch, O) and "subtask" (*batch, 1), got '
                f"{type(tensordict).__name__}"
            )
        width = tensordict["observation"].shape[-1]
        if width != self._width:
            raise ValueError(
                f"this chain is of {self._piece}, whose observations have {self._width} numbers; got {width}"
            )
        subtask = tensordict["subtask"].reshape(-1).clamp(0, len(self.policies) - 1)
        observation = tensordict.select("observation").reshape(-1)
        action = None
        for index, policy in enumerate(self.policies):
            rows = (subtask == index).nonzero().squeeze(-1)
            if not len(rows):
                continue
            part = policy(observation[rows])["action"]
            if action is None:
                action = torch.zeros((*subtask.shape, part.shape[-1]), dtype=part.dtype, device=part.device)
            action[rows] = part
        if action is None:  # a batch of no rows
            action = self.policies[0](observation)["action"]
        return tensordict.set("action", action.reshape(*tensordict.batch_size, action.shape[-1]))


def check_order(skills: Sequence[Skill]) -> None:
    """Raises InvalidValueError unless these are the skills of subtasks 0, 1, ... of one task, in order."""
    order, tasks = [skill.subtask for skill in skills], {skill.task for skill in skills}
    if not order or order != list(range(len(order))):
        raise InvalidValueError(f"a chain needs the skills of subtasks 0, 1, ... in order; got {order}")
    if len(tasks) > 1:
        raise InvalidValueError(f"a chain is of one task; got skills of {', '.join(sorted(tasks))}")


def save_chain(skills: Sequence[Skill], path: str | Path, **record: Any) -> None:
    """Writes every skill of a chain to <path>/skill<i>, each with the record.

    They take the place of what was at `path` together: a kill leaves the old chain or the new one, the old one perhaps
    beside it, from where the next save or run puts it back (`files.put_back`). Each also records which chain it is of
    and how many skills that has, so that none can be lost unnoticed.

    Raises:
        InvalidValueError: for skills that make no chain (`check_order`), or a folder of something else
            (`checkpoint.check_place`). What is there stays.
    """
    check_order(skills)
    check_place(path)
    whole = {"id": uuid.uuid4().hex, "skills": len(skills)}
    with replacing_folder(Path(path)) as stage:
        for index, skill in enumerate(skills):
            skill.save(stage / f"skill{index}", **record, chain=whole)


def chain_folders(path: Path) -> list[Path]:
    """The folders of the skills of the chain at `path`, in order; none if there is no chain.

    Skills that say nothing of a chain (saved one by one, or by older versions) are taken as they stand.

    Raises:
        DamagedCheckpointError: if a skill is missing, or is of another chain than the first one; it is named.
    """
    records = {index: read_record(folder) for index, folder in _skills_at(path).items()}
    if not records:
        return []
    whole = next((record["chain"] for record in records.values() if "chain" in record), None)
    number = max(records) + 1 if whole is None else whole["skills"]
    wrong = [f"skill{index} is missing" for index in range(number) if index not in records]
    for index, record in records.items():
        if record.get("chain") != whole:
            wrong.append(f"skill{index} is not of the chain of the others")
        elif record["subtask"] != index:
            wrong.append(f"skill{index} is the skill of subtask {record['subtask']}")
    if wrong:
        raise DamagedCheckpointError(
            f"{path} is damaged: {'; '.join(wrong)}. Put it back from a copy, or run what made the chain again"
        )
    return [path / f"skill{index}" for index in range(number)]


def load_chain(path: str | Path, **expected: Any) -> list[Skill]:
    """What `save_chain` wrote to `path`; see `Skill.load` for what is expected.

    Raises:
        MissingFileError: if there is none; a FileNotFoundError.
        DamagedCheckpointError: see `chain_folders`.
        CheckpointMismatchError: see `Skill.load`; also if another chain took its place while it was read.
    """
    path = Path(path)
    folders = chain_folders(path)
    if not folders:
        raise MissingFileError(f"no chain at {path}{_where_else(path)}")
    whole = chain_record(folders[0])
    return [Skill.load(folder, **expected, chain=whole) for folder in folders]


def chain_record(skill: Path) -> dict[str, Any] | None:
    """What the skill saved in a folder says of the chain that it is of, as `chain` of what is expected; None: of none.

    Skills that are loaded one by one with it are of one chain, though another takes its place meanwhile.
    """
    return read_record(skill).get("chain")


def _where_else(path: Path) -> str:
    """What a message says of a chain that is not at `path`: where it is, or what makes it."""
    if is_checkpoint(path):
        return f", which is {kind_of(read_record(path))}"
    near = [place for place in (path / "last", path / "best", path.parent) if _skills_at(place)]
    return f": there is one at {near[0]}" if near else made_by(path)


def _skills_at(path: Path) -> dict[int, Path]:
    """The folders skill<i> below `path` that hold a checkpoint, damaged or not, by their number, in order."""
    found = {re.fullmatch(r"skill(\d+)", folder.name): folder for folder in path.glob("skill*")}
    numbered = {int(name[1]): folder for name, folder in found.items() if name and is_checkpoint(folder)}
    return dict(sorted(numbered.items()))
