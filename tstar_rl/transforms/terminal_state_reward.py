"""The paper's terminal state regularisation, and the constant bonus that is its control."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from tstar_rl.checks import InvalidValueError
from tstar_rl.equations import terminal_state_reward
from tstar_rl.transforms.reward_transform import RewardTransform, taken_steps


class ConstantBonus(nn.Module):
    """Stands in for d_omega and says the same of every state: what a success bonus alone would do.

    Args:
        value: in [0, 1].

    Raises:
        InvalidValueError: if the value is outside, where the reward's clipping would change it.
    """

    def __init__(self, value: float) -> None:
        super().__init__()
        if not 0.0 <= value <= 1.0:
            raise InvalidValueError(
                f"the bonus is clipped to [0, 1] like d_omega, so it must lie there; got {value}"
            )
        self.value = value

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., D) -> (..., 1)."""
        return torch.full_like(obs[..., :1], self.value)


class TerminalStateReward(RewardTransform):
    """("next", "reward_tsr"): how well the next skill could start where this one succeeded; 0 on other steps.

    Args:
        d_omega: of the *next* skill, (..., O) -> (..., 1), raw. Only read. One that has not learned yet is paid as any
            other; recipes hold it back with `turn.once_learned`.
        score: "terminal" scores the state reached, s_T, which the next skill starts from (the paper);
            "before" the state in which the last action was taken.
        baseline: "none" (the paper), or "running_mean" to subtract an exponential mean of the scores of
            successes, these included, so that only what tells one success from another is paid, not success itself.
            The mean is this transform's: recipes make one for every turn, so that it begins anew there, and the first
            successes of a turn set it.
        momentum: weight of one success in the running mean.

    Raises:
        InvalidValueError: if `score` or `baseline` is not one of these, or momentum is not in (0, 1]; later, if `said`
            gives another shape.

    Source: the paper, eq. 2.
    """

    mean: Tensor
    successes: Tensor

    def __init__(
        self, d_omega: nn.Module, score: str = "terminal", baseline: str = "none", momentum: float = 0.01
    ) -> None:
        if score not in ("terminal", "before"):
            raise InvalidValueError(f"terminal_reward.score must be 'terminal' or 'before', got {score!r}")
        if baseline not in ("none", "running_mean"):
            raise InvalidValueError(
                f"terminal_reward.baseline must be 'none' or 'running_mean', got {baseline!r}"
            )
        if not 0.0 < momentum <= 1.0:
            raise InvalidValueError(f"terminal_reward.momentum must be in (0, 1], got {momentum}")
        super().__init__("reward_tsr")
        self.network = d_omega
        self.score = score
        self.baseline = baseline
        self.momentum = momentum
        self.register_buffer("mean", torch.zeros(()))
        self.register_buffer("successes", torch.zeros((), dtype=torch.int64))

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """(*batch, 1): in [0, 1], or in [-1, 1] with a baseline."""
        success = self.read(following, "success")
        obs = self.read(following if self.score == "terminal" else current, "observation")
        reward = torch.zeros(success.shape, dtype=obs.dtype, device=obs.device)
        reached, taken = success.squeeze(-1), taken_steps(current)
        reached = reached if taken is None else reached & taken
        if not reached.any():  # the usual case: the network need not run
            return reward
        scores = terminal_state_reward(self._said(obs[reached]), success[reached])
        self._update_mean(scores)
        reward[reached] = scores - self.mean if self.baseline == "running_mean" else scores
        return reward

    def said(self, obs: Tensor) -> Tensor:
        """What is said of states obs (n, O), (n, 1), before it is clipped to [0, 1]."""
        return self.network(obs)

    def _said(self, obs: Tensor) -> Tensor:
        said, wanted = self.said(obs), (len(obs), 1)
        if said.shape != wanted:
            raise InvalidValueError(
                f"{type(self).__name__}.said must give one number of each state, {wanted} of {tuple(obs.shape)}; got "
                f"{tuple(said.shape)}"
            )
        return said

    def _update_mean(self, scores: Tensor) -> None:
        """Moves the mean towards that of scores (n, 1), with the weight of n successes; the first of all set it."""
        n = scores.shape[0]
        weight = 1.0 if self.successes == 0 else 1.0 - (1.0 - self.momentum) ** n
        self.mean.lerp_(scores.mean().to(self.mean.device), weight)
        self.successes.add_(n)
