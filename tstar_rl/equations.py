"""The paper's rewards and losses as pure functions of tensors; `signal_equations` has those of other chaining methods.

"The paper" is Lee et al., *Adversarial Skill Chaining for Long-Horizon Robot Manipulation via Terminal State
Regularization*, CoRL 2021; "AMP" is Peng et al., 2021, whose formulation of GAIL the paper adopts; "SPiRL" is
Pertsch et al., *Accelerating Reinforcement Learning with Learned Skill Priors*, CoRL 2020. Every
function keeps the shape of its arguments (they broadcast) unless it says that it returns a mean or a sum.
Discriminator outputs come in raw: they are clipped here, where a reward is made of them, and nowhere else.
"""

from collections.abc import Sequence

import torch
from torch import Tensor


def gail_reward(f: Tensor) -> Tensor:
    """The reward of resembling an expert, 1 - 0.25 (f - 1)^2, clipped to [0, 1].

    Args:
        f: raw output of the GAIL discriminator; +1 is what it should say of an expert's state, -1 of an agent's.

    Returns:
        Same shape, in [0, 1]: 1 at f = 1, 0 at f <= -1 and f >= 3.

    Source: the paper, text below eq. 1, and AMP eq. 7.
    """
    return (1.0 - 0.25 * (f - 1.0).square()).clamp(0.0, 1.0)


def terminal_state_reward(d: Tensor, in_termination_set: Tensor) -> Tensor:
    """The terminal state regularisation: d clipped to [0, 1] where the skill has succeeded, 0 elsewhere.

    Args:
        d: raw output of the *next* skill's initiation set discriminator for the state reached; 1 is what it should
            say of a state that the next skill succeeds from.
        in_termination_set: bool, same shape; the state ends a success of this skill.

    Returns:
        Same shape, in [0, 1].

    Source: the paper, eq. 2; the clipping from its appendix B.
    """
    return torch.where(in_termination_set, d.clamp(0.0, 1.0), torch.zeros_like(d))


def weighted_reward(rewards: Sequence[Tensor], weights: Sequence[float]) -> Tensor:
    """The reward that a policy learns from, the sum of weight times reward.

    Learning one subtask it is lambda_1 r_env + lambda_2 r_gail (eq. 1); chaining adds lambda_3 r_tsr (eq. 3).

    Args:
        rewards: at least one, all of one shape.
        weights: of the rewards, in their order.

    Returns:
        Same shape.

    Source: the paper, eq. 1 and 3.
    """
    terms = [weight * reward for weight, reward in zip(weights, rewards, strict=True)]
    return sum(terms[1:], start=terms[0])


def least_squares_loss(scores: Tensor, label: float) -> Tensor:
    """The mean squared distance of a discriminator's scores from a label.

    The loss of f_phi is that of an expert's states to +1 plus that of an agent's to -1; the loss of d_omega is that of
    initiation sets to 1 plus that of the termination set before to 0.

    Args:
        scores: raw outputs, any shape.
        label: what they should be.

    Returns:
        A scalar.

    Source: the paper, text below eq. 1 (AMP eq. 6), and L_i(omega) in section 3.3.
    """
    return (scores - label).square().mean()


def gradient_penalty(grad: Tensor) -> Tensor:
    """The zero-centred gradient penalty, half the mean squared norm of the gradient.

    Args:
        grad: gradients of a discriminator with respect to its inputs, (..., D).

    Returns:
        A scalar, to be multiplied by the penalty's weight (10).

    Source: AMP eq. 8 (which has the half).
    """
    return 0.5 * grad.square().sum(-1).mean()


def unit_gradient_penalty(grad: Tensor) -> Tensor:
    """The gradient penalty that is centred at one, the mean squared distance of the gradient's norm from 1.

    Args:
        grad: gradients of a discriminator with respect to its inputs, (..., D).

    Returns:
        A scalar, to be multiplied by the penalty's weight (10).

    Source: Gulrajani et al. 2017, eq. 3; `_compute_grad_pen` in the code released with the paper.
    """
    return (grad.norm(dim=-1) - 1.0).square().mean()


def gaussian_kl(loc: Tensor, scale: Tensor, other_loc: Tensor, other_scale: Tensor) -> Tensor:
    """KL(N(loc, scale) || N(other_loc, other_scale)) of diagonal Gaussians, summed over their dimensions.

    Args:
        loc: (..., D), scale: (..., D) deviations, > 0; so of the other.

    Returns:
        (...), >= 0.

    Source: SPiRL, the divergences of eq. 1, 2 and 4.
    """
    ratio = (scale / other_scale).square()
    shift = ((loc - other_loc) / other_scale).square()
    return 0.5 * (ratio + shift - 1.0 - ratio.log()).sum(-1)


def latent_reconstruction_loss(decoded: Tensor, actions: Tensor) -> Tensor:
    """Minus the log likelihood of the actions under unit Gaussians around the decoded actions, without its constant.

    Args:
        decoded: (..., H, A), actions: (..., H, A).

    Returns:
        A scalar, the mean over all elements, as in the code released with SPiRL. That code takes the mean over the
        latent's dimensions too, of what `latent_regularisation_loss` sums: its beta is Z times the one here.

    Source: SPiRL, eq. 1, first term.
    """
    return 0.5 * (decoded - actions).square().mean()


def latent_regularisation_loss(loc: Tensor, scale: Tensor, beta: float) -> Tensor:
    """beta KL(q(z | a) || N(0, 1)).

    Args:
        loc: (..., Z), scale: (..., Z), of the posterior q.
        beta: its weight.

    Returns:
        A scalar, the mean over windows.

    Source: SPiRL, eq. 1, second term.
    """
    return beta * gaussian_kl(loc, scale, torch.zeros_like(loc), torch.ones_like(scale)).mean()


def latent_prior_loss(loc: Tensor, scale: Tensor, prior_loc: Tensor, prior_scale: Tensor) -> Tensor:
    """KL(stop(q(z | a)) || p(z | s)): the prior is trained towards the posterior, which gets no gradient.

    Args:
        loc: (..., Z), scale: (..., Z), of the posterior q; no gradient reaches them.
        prior_loc: (..., Z), prior_scale: (..., Z), of the prior p.

    Returns:
        A scalar, the mean over windows.

    Source: SPiRL, section 3.2.
    """
    return gaussian_kl(loc.detach(), scale.detach(), prior_loc, prior_scale).mean()


def prior_regularised_value(q: Tensor, divergence: Tensor, alpha: Tensor | float) -> Tensor:
    """The value of a state, Q(s, z) - alpha KL(pi(z | s) || p(z | s)): what the policy maximises and Q looks ahead to.

    Source: SPiRL, eq. 4 and algorithm 1; the KL stands where soft actor-critic has log pi.
    """
    return q - alpha * divergence


def divergence_dual_loss(log_alpha: Tensor, divergence: Tensor, target_divergence: float) -> Tensor:
    """Its descent raises alpha while the divergence exceeds its target and lowers it below.

    log_alpha (target - divergence), no gradient to the divergence. In log alpha, as TorchRL's `SACLoss` has it.

    Source: SPiRL, algorithm 1, the update of alpha.
    """
    return log_alpha * (target_divergence - divergence.detach())
