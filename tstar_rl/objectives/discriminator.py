"""The loss of a discriminator: f_phi, d_omega, or any other network that scores states of two kinds."""

from collections.abc import Callable, Mapping

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.objectives import LossModule

from tstar_rl.equations import gradient_penalty, least_squares_loss, unit_gradient_penalty
from tstar_rl.models.networks import Discriminator

__all__ = ["DiscriminatorLoss"]


class DiscriminatorLoss(LossModule):
    """Least squares towards a label for each of two kinds of states, and a gradient penalty.

    Reads "<kind>_observation" (batch, O) of both kinds. Writes "loss_discriminator", "loss_gradient_penalty" and the
    mean scores "<kind>_score". The loss is the sum of the entries whose names begin with "loss_".

    The penalty pulls the gradient to zero at states of the first kind (`gradient_penalty`). If "between" (batch, 1) in
    [0, 1] is there, it pulls the gradient's norm to one at points between states of both kinds instead
    (`unit_gradient_penalty`): at 0 the point is the state of the first kind, at 1 that of the second.

    The gradient is taken with respect to the *normalised* observation: with respect to the raw one it would weigh a
    dimension by how little it varies.

    Args:
        network: trained through this module's parameters; a reward transform reads it.
        labels: what the network should say of each kind, for example expert=1, agent=-1 for f_phi, or initiation=1,
            termination=0 for d_omega. Their order counts, see above.
        gradient_penalty_weight: 0 leaves the penalty out.

    Raises:
        ValueError: if there are not two labels, or the weight is negative.

    Source: the paper, text below eq. 1 (f_phi) and L_i(omega) in section 3.3 (d_omega), which has no penalty; AMP eq. 8
    for the penalty at the first kind. The code released with the paper has that between the kinds, for f_phi and
    d_omega (`_compute_grad_pen` of `gail_agent.py` and of `policy_sequencing_agent.py`). There the gradient is that of
    the observation's first entry alone, the poses of the parts; here it is that of the whole observation.
    """

    def __init__(
        self, network: Discriminator, labels: Mapping[str, float], gradient_penalty_weight: float = 10.0
    ) -> None:
        super().__init__()
        if len(labels) != 2:
            raise ValueError(f"a discriminator needs labels of two kinds of states, got {dict(labels)}")
        if gradient_penalty_weight < 0:
            raise ValueError(f"gradient_penalty_weight must not be negative, got {gradient_penalty_weight}")
        self.network = network
        self.labels = dict(labels)
        self.gradient_penalty_weight = gradient_penalty_weight
        self.in_keys = [f"{kind}_observation" for kind in self.labels]
        self.out_keys = [
            "loss_discriminator",
            "loss_gradient_penalty",
            *(f"{kind}_score" for kind in self.labels),
        ]

    def _forward_value_estimator_keys(self, **kwargs) -> None:
        pass

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: "<kind>_observation" (batch, O) of both kinds, "between" (batch, 1) -> losses and mean scores."""
        (first, first_label), (second, second_label) = self.labels.items()
        rows, others = (
            self.network.normalize(tensordict.get(f"{kind}_observation")).detach() for kind in (first, second)
        )
        between, other_scores = tensordict.get("between", None), self.network.score(others)
        if between is None:
            scores, penalty = self._score_and_penalty(rows, gradient_penalty)
        else:
            scores = self.network.score(rows)
            _, penalty = self._score_and_penalty(torch.lerp(rows, others, between), unit_gradient_penalty)
        loss = least_squares_loss(scores, first_label) + least_squares_loss(other_scores, second_label)
        return TensorDict(
            {
                "loss_discriminator": loss,
                "loss_gradient_penalty": penalty,
                f"{first}_score": scores.detach().mean(),
                f"{second}_score": other_scores.detach().mean(),
            }
        )

    def _score_and_penalty(
        self, normalized: Tensor, penalty: Callable[[Tensor], Tensor]
    ) -> tuple[Tensor, Tensor]:
        """normalized: (batch, O) -> raw scores (batch, 1) and the weighted gradient penalty there, a scalar."""
        if not self.gradient_penalty_weight:
            return self.network.score(normalized), normalized.new_zeros(())
        normalized = normalized.requires_grad_()
        scores = self.network.score(normalized)
        (grad,) = torch.autograd.grad(scores.sum(), normalized, create_graph=True)
        return scores, self.gradient_penalty_weight * penalty(grad)
