"""States of demonstrations as the starts of episodes."""

import torch
from tensordict import TensorDictBase

from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations

__all__ = ["DemonstrationStarts"]


class DemonstrationStarts:
    """Draws states of demonstrations, uniformly over all their steps, with replacement.

    An episode that begins there goes on from what the demonstration had done: the phase, and what was paid. So a policy
    sees the later phases before it can reach them. Short episodes see more of them: one that is stuck ends soon.

    Args:
        demonstrations: whose snapshots are drawn.
        limit: of an episode's steps, with those that the demonstration had made; where `steps` is None
            states from beyond it are not drawn.
        steps: that an episode from there has, whatever the demonstration had made; None: those that the limit leaves.

    Raises:
        InvalidValueError: the demonstrations have no states, or none before the limit; `steps` is more than the limit.

    Source: Peng et al. 2018, DeepMimic, "reference state initialization"; Nair et al. 2018, "resets".
    """

    def __init__(self, demonstrations: Demonstrations, limit: int, steps: int | None = None) -> None:
        self.snapshots = demonstrations.snapshots
        if self.snapshots.is_empty():
            raise InvalidValueError(
                "training.demonstration_starts needs demonstrations with full states; these have none: set it to 0"
            )
        if steps is not None and steps > limit:
            raise InvalidValueError(
                f"training.demonstration_steps must be at most {limit}, the steps of a whole episode "
                f"(training.max_steps a subtask); got {steps}"
            )
        if steps is None:
            self.snapshots = self.snapshots[self.snapshots["task", "episode_step"] < limit]
            if not self.snapshots.batch_size[0]:
                raise InvalidValueError(
                    f"no demonstration has a state before step {limit}, where an episode ends (training.max_steps a "
                    "subtask): raise that, or set training.demonstration_steps, the steps of an episode from there"
                )
        else:
            self.snapshots = self.snapshots.clone()
            self.snapshots["task", "episode_step"].fill_(limit - steps)

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """n snapshots, batch size [n]."""
        rows = torch.randint(self.snapshots.batch_size[0], (n,), generator=generator)
        return self.snapshots[rows]
