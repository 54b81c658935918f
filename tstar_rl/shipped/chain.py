"""A trained chain as it is shipped: its policies, what the next skills' d_omega say, and where both come from.

Optimisers, value networks, f_phi and the state sets stay behind: of a skill of 5 MB 0.24 are left. The policies are
kept to the bit, so that their figures are those of the tables; d_omega, which is only looked at, in half precision.
"""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor, nn

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.models.draws import generators_stay
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import differences
from tstar_rl.runs.saved_kinds import A_SHIPPED_CHAIN, kind_of

__all__ = ["ShippedChain", "load_shipped", "save_shipped"]


class ShippedChain(ChainPolicy):
    """A `ChainPolicy` that knows where it comes from; a map from "observation", "subtask" to "action".

    Args:
        skills: in the order of the subtasks.
        record: plain values: `task`, `env` (settings of the task), `figures`, and what else was noted.
        signal: whether it has the d_omega of the skills of subtasks 1, 2, ...
    """

    def __init__(self, skills: Sequence[Skill], record: Mapping[str, Any], signal: bool) -> None:
        super().__init__(skills)
        self.record = dict(record)
        self.d_omega = nn.ModuleList(skill.d_omega for skill in skills[1:] if signal)

    @property
    def task(self) -> str:
        """The furniture."""
        return self.record["task"]

    @property
    def env_settings(self) -> dict[str, Any]:
        """The settings that it was trained with: `FurnitureEnv(chain.task, 16, **chain.env_settings)`."""
        return dict(self.record["env"])

    @property
    def sha256(self) -> str:
        """Of its policies: chains that have the same act alike, wherever they lie and whatever they are called."""
        digest = hashlib.sha256()
        for name, value in sorted(self.policies.state_dict().items()):
            digest.update(name.encode() + value.cpu().numpy().tobytes())
        return digest.hexdigest()

    def compare(self, row: Mapping[str, Any], env: Mapping[str, Any]) -> str:
        """What an evaluation makes of the figures recorded.

        Args:
            row: of the table of evaluations.
            env: settings of the task in which it was made.
        """
        if other := differences(self.env_settings, dict(env), "env"):
            return f"{row['mode']}: another world than that of the figures recorded: {'; '.join(other)}"
        recorded = self.record["figures"].get(row["mode"], {})
        asked = [row["seed"], row["episodes"]]
        if asked != [self.record["seed"], recorded.get("episodes")]:
            return f"{row['mode']}: other episodes than those of the figures recorded"
        other = [
            f"{name} was {recorded[name]:g}, is {row[name]:g}"
            for name in ("progress", "success", "episode_length")
            if abs(row[name] - recorded[name]) > 1e-9
        ]
        return f"{row['mode']}: {'; '.join(other) or 'the figures recorded'}"


class _Weights:
    """What a checkpoint holds of a shipped chain. The normaliser in d_omega is that of its skill's policy."""

    def __init__(self, chain: ShippedChain) -> None:
        self.chain = chain

    def state_dict(self) -> dict[str, Tensor]:
        kept = {name: value.half() for name, value in self._signal().items() if ".normalizer." not in name}
        return self.chain.policies.state_dict(prefix="policies.") | kept

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        shared = {name: value for name, value in self._signal().items() if ".normalizer." in name}
        self.chain.load_state_dict({**shared, **state})

    def _signal(self) -> dict[str, Tensor]:
        return self.chain.d_omega.state_dict(prefix="d_omega.")


def save_shipped(skills: Sequence[Skill], path: str | Path, signal: bool, **record: Any) -> None:
    """Writes a shipped chain, and beside it plain values that say what it is.

    Args:
        skills: in the order of the subtasks.
        path: its folder; what was there is replaced.
        signal: whether d_omega is written too; only one that was trained says anything.
        **record: plain values; at least `task`, `env`, `seed`, `checkpoint`, `figures` (a row of the evaluation for
            each mode) and `says`, what the chain is in a word or two, which recipes read.
    """
    built = [{name: value for name, value in skill.built().items() if name != "capacity"} for skill in skills]
    chain = ShippedChain(skills, record, signal)
    checkpoint.save(path, {"chain": _Weights(chain)}, {**record, "signal": signal, "built": built})


def load_shipped(path: str | Path, **expected: Any) -> ShippedChain:
    """The chain that `save_shipped` wrote to `path`. Torch's generator is left as it was.

    Raises:
        MissingFileError, DamagedCheckpointError, CheckpointMismatchError: see `checkpoint.load`.
        InvalidValueError: if something else is saved there.
    """
    record = checkpoint.read_record(path, **expected)
    if (kind := kind_of(record)) != A_SHIPPED_CHAIN:
        raise InvalidValueError(f"{path} is {kind}; ship.py makes a shipped chain of a trained one")
    with generators_stay():
        skills = [
            Skill.from_built(record["task"], index, built) for index, built in enumerate(record["built"])
        ]
    chain = ShippedChain(skills, record, record["signal"])
    checkpoint.load(path, {"chain": _Weights(chain)}, **expected)
    return chain.requires_grad_(False).eval()
