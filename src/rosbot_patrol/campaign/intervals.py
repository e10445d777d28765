"""Confidence interval of a share: Wilson's score interval (1927), valid for few trials, and for all or none."""

from __future__ import annotations

import math

Z95 = 1.959964  # of the normal distribution


def wilson(hits: int, trials: int, z: float = Z95) -> tuple[float, float]:
    """Bounds of the true share, at a level of 95 % by default.

    Args:
        hits: number of successful trials.
        trials: number of all trials.
        z: quantile of the normal distribution.
    """
    if not 0 <= hits <= trials:
        raise ValueError(f"{hits} of {trials}")
    if trials == 0:
        return 0.0, 1.0
    share = hits / trials
    middle = share + z**2 / (2 * trials)
    spread = z * math.sqrt(share * (1.0 - share) / trials + z**2 / (4 * trials**2))
    weight = 1.0 + z**2 / trials
    low = 0.0 if hits == 0 else (middle - spread) / weight
    high = 1.0 if hits == trials else (middle + spread) / weight
    return low, high
