"""What an update on random minibatches goes on from after a kill."""

from typing import Any

import torch


class SampledUpdate:
    """An optimiser, and the generator of its minibatches.

    Args:
        optimizer: of the network's parameters.
        seed: of the generator, which is on their device.
    """

    def __init__(self, optimizer: torch.optim.Optimizer, seed: int) -> None:
        self.optimizer = optimizer
        self.device = optimizer.param_groups[0]["params"][0].device
        self.generator = torch.Generator(self.device).manual_seed(seed)

    @property
    def has_learned(self) -> bool:
        """Whether it has made a step since it was made; one without data makes none."""
        return bool(self.optimizer.state)

    def state_dict(self) -> dict[str, Any]:
        """Optimiser and generator."""
        return {"optimizer": self.optimizer.state_dict(), "generator": self.generator.get_state()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        self.optimizer.load_state_dict(state["optimizer"])
        self.generator.set_state(state["generator"])
