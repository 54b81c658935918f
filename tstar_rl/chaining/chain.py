"""Skills one after another: the policy that runs them, and the folder that they are kept in."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import nn

from tstar_rl.chaining.skill import Skill

__all__ = ["ChainPolicy", "chain_folders", "load_chain", "save_chain"]


class ChainPolicy(TensorDictModuleBase):
    """Map from "observation", "subtask" to "action": each row acts with the policy of its own subtask.

    Rows past the last subtask (the task is done) act with the last skill. Sampling follows TorchRL's
    `set_exploration_type`, as each skill's own policy does.

    Args:
        skills: in the order of the subtasks.

    Raises:
        ValueError: if there are none, or one stands in another's place.
    """

    def __init__(self, skills: Sequence[Skill]) -> None:
        super().__init__()
        order = [skill.subtask for skill in skills]
        if not order or order != list(range(len(order))):
            raise ValueError(f"a chain needs the skills of subtasks 0, 1, ... in order; got {order}")
        self.in_keys, self.out_keys = ["observation", "subtask"], ["action"]
        self.policies = nn.ModuleList(skill.policy for skill in skills)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: batch [N] -> the same with "action" (N, 9)."""
        subtask = tensordict["subtask"].squeeze(-1).clamp(0, len(self.policies) - 1)
        observation = tensordict.select("observation")
        action = None
        for index, policy in enumerate(self.policies):
            rows = (subtask == index).nonzero().squeeze(-1)
            if not len(rows):
                continue
            part = policy(observation[rows])["action"]
            if action is None:
                action = torch.zeros((*subtask.shape, part.shape[-1]), dtype=part.dtype, device=part.device)
            action[rows] = part
        return tensordict.set("action", action)


def save_chain(skills: Sequence[Skill], path: Path, **record: Any) -> None:
    """Writes every skill of a chain to <path>/skill<i>, each with the record."""
    for index, skill in enumerate(skills):
        skill.save(path / f"skill{index}", **record)


def chain_folders(path: Path) -> list[Path]:
    """The folders of the skills of the chain at `path`, in order; none if there is no chain."""
    return sorted(path.glob("skill*"), key=lambda folder: int(folder.name.removeprefix("skill")))


def load_chain(path: Path, **expected: Any) -> list[Skill]:
    """What `save_chain` wrote to `path`; see `Skill.load` for what is expected.

    Raises:
        FileNotFoundError: if there is none.
    """
    folders = chain_folders(path)
    if not folders:
        raise FileNotFoundError(f"no chain at {path}")
    return [Skill.load(folder, **expected) for folder in folders]
