"""Carries the first observation of an episode to its last row."""

from typing import cast

from tensordict import TensorDictBase
from torchrl.data import Composite, TensorSpec
from torchrl.envs import Transform


class EpisodeStart(Transform):
    """Writes "start_observation": s_0 on every row of its episode, so that I_i can grow by a mask on successes.

    It works in an environment only: a batch of loose steps does not know where its episodes began.
    """

    def __init__(self) -> None:
        super().__init__(in_keys=["observation"], out_keys=["start_observation"])

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        observation = tensordict_reset.get("observation", None)
        if observation is None:
            there = ", ".join(map(str, tensordict_reset.keys()))
            raise KeyError(f"EpisodeStart: the environment has no 'observation'; it has {there}")
        # Rows that are not being reset get back their own entry from TorchRL afterwards.
        return tensordict_reset.set("start_observation", observation.clone())

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        start = tensordict.get("start_observation", None)
        if start is None:
            raise KeyError("EpisodeStart: the step has no 'start_observation'; begin with env.reset()")
        next_tensordict.set("start_observation", start.clone())
        return next_tensordict

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Not supported.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError(
            "EpisodeStart needs resets: append it to an environment, not to a replay buffer, a postproc or a model"
        )

    def transform_observation_spec(self, observation_spec: TensorSpec) -> TensorSpec:
        """Adds "start_observation", like "observation"."""
        observation_spec = cast(Composite, observation_spec)
        observation_spec["start_observation"] = observation_spec["observation"].clone()
        return observation_spec
