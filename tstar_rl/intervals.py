"""Confidence intervals of a share, for evaluation and for the tables."""

import math

__all__ = ["share_columns", "wilson_interval"]


Z = 1.96
"""Deviations of a normal distribution that 95% of it lie within."""


def wilson_interval(successes: float, episodes: int) -> tuple[float, float]:
    """The 95% confidence interval of a share.

    Of values between 0 and 1, with `successes` their sum, it is too wide, since these vary less than a share's 0 and 1.

    Source: Wilson 1927.
    """
    if episodes < 1 or not 0 <= successes <= episodes:
        raise ValueError(f"need 0 <= successes <= episodes and episodes >= 1, got {successes} of {episodes}")
    share, scale = successes / episodes, 1 + Z**2 / episodes
    centre = (share + Z**2 / (2 * episodes)) / scale
    half = Z / scale * math.sqrt(share * (1 - share) / episodes + Z**2 / (4 * episodes**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def share_columns(name: str, successes: int, episodes: int) -> dict[str, float]:
    """A share with its 95% interval, as the columns <name>, <name>_low, <name>_high of a table; NaN of no episodes."""
    share, (low, high) = math.nan, (math.nan, math.nan)
    if episodes:
        share, (low, high) = successes / episodes, wilson_interval(successes, episodes)
    return {name: share, f"{name}_low": low, f"{name}_high": high}
