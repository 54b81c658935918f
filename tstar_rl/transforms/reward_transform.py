"""What the reward transforms have in common: where TorchRL calls them, and the spec of what they write."""

from typing import cast

import torch
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.data import Composite, TensorSpec, Unbounded
from torchrl.envs import Transform

from tstar_rl.checks import InvalidValueError


class RewardTransform(Transform):
    """Writes ("next", out_key) from (s, s') alone, in an environment, as a postproc or in a replay buffer.

    A subclass says how in `reward`. In an environment the value is computed at the step, and is 0 where TorchRL's
    "_step" leaves a simulation out; elsewhere `forward` takes a batch of any shape that has a "next" entry.

    Args:
        out_key: name of the reward, below "next".
    """

    def __init__(self, out_key: str) -> None:
        super().__init__(in_keys=[], out_keys=[out_key])

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """The reward (*batch, 1) of the step from `current` (s) to `following` (s').

        Raises:
            NotImplementedError: unless a subclass says what it is.
        """
        raise NotImplementedError(f"{type(self).__name__} must define reward(current, following)")

    @torch.no_grad()
    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        said, taken = self._checked(tensordict, next_tensordict), taken_steps(tensordict)
        next_tensordict.set(self.out_keys[0], said if taken is None else said * taken.unsqueeze(-1))
        return next_tensordict

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Writes the reward into a batch of steps, in place.

        Raises:
            KeyError: if there is no "next" in the batch.
            InvalidValueError: if the reward is no tensor, has another shape, or is not finite; likewise in an
                environment.
        """
        following = tensordict.get("next", None)
        if following is None:
            raise KeyError(
                f"{type(self).__name__} needs steps, with the state reached under 'next'; got only {_names(tensordict)}"
            )
        following.set(self.out_keys[0], self._checked(tensordict, following))
        return tensordict

    def _checked(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """What `reward` says, which would otherwise ruin a policy without a word."""
        said, wanted = self.reward(current, following), (*following.batch_size, 1)
        if not isinstance(said, Tensor):
            raise InvalidValueError(
                f"{type(self).__name__}.reward must return a tensor of shape {wanted}, got {type(said).__name__}"
            )
        if said.shape != wanted:
            raise InvalidValueError(
                f"{type(self).__name__} must give {self.out_keys[0]} of shape {wanted}, got {tuple(said.shape)}"
            )
        if not said.is_meta and not bool(said.isfinite().all()):
            raise InvalidValueError(
                f"{type(self).__name__} must give finite numbers, got {int((~said.isfinite()).sum())} of "
                f"{said.numel()} in {self.out_keys[0]} that are not"
            )
        return said.to(torch.float32)

    def transform_reward_spec(self, reward_spec: TensorSpec) -> TensorSpec:
        """Adds the reward, (*batch, 1) and unbounded."""
        shape = torch.Size((*reward_spec.shape, 1))
        reward_spec = cast(Composite, reward_spec)
        reward_spec[self.out_keys[0]] = Unbounded(shape=shape, device=reward_spec.device, dtype=torch.float32)
        return reward_spec

    def read(self, tensordict: TensorDictBase, key: NestedKey) -> Tensor:
        """tensordict[key], or a KeyError that names this transform, the key and the keys at hand."""
        value = tensordict.get(key, None)
        if value is None:
            raise KeyError(f"{type(self).__name__} needs {key!r}; got only {_names(tensordict)}")
        return value


def taken_steps(tensordict: TensorDictBase) -> Tensor | None:
    """Which simulations take a step, (*batch,) bool; None: all. A `step` may leave some out, by TorchRL's "_step"."""
    taken = tensordict.get("_step", None)
    return None if taken is None else taken.reshape(tensordict.batch_size)


def _names(tensordict: TensorDictBase) -> str:
    return ", ".join(sorted(str(key) for key in tensordict.keys())) or "nothing"
