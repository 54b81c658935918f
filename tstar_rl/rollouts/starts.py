"""Where the episodes of a chained skill begin: the sources, their shares, and a mixture of them."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import TransformedEnv

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.state_sets import StateSet, TerminationSet
from tstar_rl.rollouts.terminal_gaussian import TerminalGaussian
from tstar_rl.transforms import SkillChainReset
from tstar_rl.transforms.skill_chain_reset import Starts, sample

__all__ = [
    "SOURCES",
    "MixedStarts",
    "check_shares",
    "gaussian_counts",
    "load_state_of_sources",
    "make_starts",
    "sources",
    "start_counts",
    "state_of_sources",
    "termination_sets",
]

SOURCES = ("environment", "gaussian", "buffer")
"""The environment's own start, a Gaussian fitted to the termination set of the skill before, a member of that set."""


class MixedStarts:
    """Draws every start from one of several sources, at random by their shares.

    Args:
        sources: each gives snapshots, or rows with a "snapshot".
        shares: of the sources, in their order; positive, scaled to a sum of 1.

    Raises:
        ValueError: if there is not one positive, finite share for each source; in `sample`, if a source gives another
            number of starts than it was asked for.
    """

    def __init__(self, sources: Sequence[Starts], shares: Sequence[float]) -> None:
        if len(sources) != len(shares) or not sources or not all(0 < share < math.inf for share in shares):
            raise ValueError(
                f"every source needs a positive share, got {len(sources)} sources, shares {list(shares)}"
            )
        self.sources = list(sources)
        self.shares = torch.tensor(shares, dtype=torch.float64) / sum(shares)

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """n snapshots, batch size [n]; [0] while a source that was asked is empty."""
        chosen = torch.multinomial(self.shares, n, replacement=True, generator=generator)
        order: list[Tensor] = []
        pieces: list[TensorDictBase] = []
        for index, source in enumerate(self.sources):
            rows = (chosen == index).nonzero().squeeze(-1)
            if not len(rows):
                continue
            drawn = sample(source, len(rows), generator)
            if not drawn.batch_size[0]:
                return TensorDict(batch_size=[0])
            order.append(rows)
            pieces.append(drawn.get("snapshot", drawn))
        together: TensorDictBase = torch.cat(pieces)  # pyright: ignore[reportAssignmentType]
        return together[torch.cat(order).argsort()]  # pyright: ignore[reportReturnType]


def check_shares(shares: Mapping[str, float]) -> dict[str, float]:
    """A share for each of `SOURCES`, 0 where none is named.

    Raises:
        InvalidValueError: for another name, a negative share, or a sum that is not 1.
    """
    unknown = [str(name) for name in shares if name not in SOURCES]
    if unknown:
        raise InvalidValueError(f"starts have no source {', '.join(unknown)}; valid: {', '.join(SOURCES)}")
    whole = {name: float(shares.get(name, 0.0)) for name in SOURCES}
    if min(whole.values()) < 0 or not math.isclose(sum(whole.values()), 1.0, abs_tol=1e-6):
        raise InvalidValueError(
            f"shares of starts must not be negative and sum to 1 (chain.starts), got {whole}"
        )
    return whole


def make_starts(
    shares: Mapping[str, float], env: Any, termination_set: TerminationSet
) -> tuple[Starts, float]:
    """The source of chained starts, and the probability of drawing from it instead of from the environment.

    Args:
        shares: by name, see `SOURCES`.
        env: that the Gaussian's draws are posed in.
        termination_set: of the skill before, read by handle.

    Returns:
        The source, and a probability of 0 where only the environment has a share.

    Source: the paper's appendix C: T-STAR 20% environment and 80% buffer, Policy Sequencing 20% and 80% Gaussian; the
    code released with it: 20%, 70% buffer, 10% Gaussian, a diagonal one.
    """
    whole = check_shares(shares)
    chained = {name: whole[name] for name in ("gaussian", "buffer") if whole[name] > 0}
    make = {"gaussian": lambda: TerminalGaussian(env, termination_set), "buffer": lambda: termination_set}
    sources = [make[name]() for name in chained]
    if not sources:
        return termination_set, 0.0
    source = sources[0] if len(sources) == 1 else MixedStarts(sources, list(chained.values()))
    return source, 1.0 - whole["environment"]


def sources(env: TransformedEnv) -> list[Starts]:
    """What the chained starts of an environment are drawn from, also where a mixture is part of another one.

    Nothing without `SkillChainReset`.
    """
    return [each for reset in _resets(env) for each in _unmixed(reset.starts)]


def _unmixed(starts: Starts) -> list[Starts]:
    if not isinstance(starts, MixedStarts):
        return [starts]
    return [each for source in starts.sources for each in _unmixed(source)]


def start_counts(env: TransformedEnv) -> dict[str, int]:
    """Where an environment's episodes have begun, "starts_environment" and "starts_chained"; nothing without a choice.

    While the set of the skill before is empty, more begin in the environment than its share of chain.starts.
    """
    return {f"starts_{name}": count for reset in _resets(env) for name, count in reset.draws.items()}


def _resets(env: TransformedEnv) -> list[SkillChainReset]:
    """Those of an environment whose transform may be one, or several, in each other or not."""
    return [each for each in env.transform.modules() if isinstance(each, SkillChainReset)]


def termination_sets(env: TransformedEnv) -> list[TerminationSet]:
    """The termination sets that an environment's starts are read from, each once."""
    sets = dict.fromkeys(getattr(each, "termination_set", each) for each in sources(env))
    return [each for each in sets if isinstance(each, TerminationSet)]


def gaussian_counts(env: TransformedEnv) -> dict[str, int]:
    """What the Gaussian among an environment's starts has drawn, as "gaussian_<what>"; nothing without one."""
    gaussians = [each for each in sources(env) if isinstance(each, TerminalGaussian)]
    return {f"gaussian_{name}": count for each in gaussians for name, count in each.counts.items()}


def state_of_sources(env: TransformedEnv) -> list[dict[str, Any]]:
    """The state of every source that has one, in their order.

    A skill saves its own sets; whoever made another set must save it.
    """
    return [each.state_dict() for each in _with_state(env)]


def load_state_of_sources(env: TransformedEnv, states: Sequence[Mapping[str, Any]]) -> None:
    """What `state_of_sources` gave; nothing where a checkpoint of an older version has none."""
    for each, state in zip(_with_state(env), states, strict=bool(states)):
        each.load_state_dict(state)


def _with_state(env: TransformedEnv) -> list[Any]:
    found = [each for each in sources(env) if not isinstance(each, StateSet)]
    return [each for each in found if hasattr(each, "state_dict") and hasattr(each, "load_state_dict")]
