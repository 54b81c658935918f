"""The loss of a network that is to say a number of every state: what came of it, or how near the end it was."""

from collections.abc import Callable

from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.objectives import LossModule

from tstar_rl.models.networks import Discriminator

__all__ = ["LabelledLoss"]


class LabelledLoss(LossModule):
    """The distance of a network's outputs from the labels of states.

    Reads "observation" (batch, O), "label" (batch, 1) and, if it is there, "noise" (batch, O), which is added to the
    *normalised* observation: its deviation says how small a difference of two states the network must not build on.
    Writes "loss_label" and "score", the mean raw output.

    Args:
        network: trained through this module's parameters; a reward transform reads it.
        distance: raw outputs and labels of one shape -> a scalar, as `signal_equations.outcome_loss`.
    """

    def __init__(self, network: Discriminator, distance: Callable[[Tensor, Tensor], Tensor]) -> None:
        super().__init__()
        self.network = network
        self.distance = distance
        self.in_keys, self.out_keys = ["observation", "label"], ["loss_label", "score"]

    def _forward_value_estimator_keys(self, **kwargs) -> None:
        pass

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: "observation", "noise" (batch, O), "label" (batch, 1) -> loss and mean score, scalars."""
        read = self.network.normalize(tensordict.get("observation")).detach()
        noise = tensordict.get("noise", None)
        scores = self.network.score(read if noise is None else read + noise)
        loss = self.distance(scores, tensordict.get("label"))
        return TensorDict({"loss_label": loss, "score": scores.detach().mean()})
