"""Confidence intervals of a share, for evaluation and for the tables."""

import math

__all__ = ["wilson_interval"]


def wilson_interval(successes: int, episodes: int, z: float = 1.96) -> tuple[float, float]:
    """Confidence interval of a share, 95% at z = 1.96.

    Source: Wilson 1927.
    """
    if episodes < 1 or not 0 <= successes <= episodes:
        raise ValueError(f"need 0 <= successes <= episodes and episodes >= 1, got {successes} of {episodes}")
    share, scale = successes / episodes, 1 + z**2 / episodes
    centre = (share + z**2 / (2 * episodes)) / scale
    half = z / scale * math.sqrt(share * (1 - share) / episodes + z**2 / (4 * episodes**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)
