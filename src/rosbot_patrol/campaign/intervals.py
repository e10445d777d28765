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


def difference(first: tuple[int, int], second: tuple[int, int], z: float = Z95) -> tuple[float, float, float]:
    """Difference of two shares, second less first, with the bounds of the true one (Newcombe 1998, method 10).

    Args:
        first: hits and trials, of at least one trial.
        second: likewise.
        z: quantile of the normal distribution.
    """
    (a, low_a, high_a), (b, low_b, high_b) = ((hits / n, *wilson(hits, n, z)) for hits, n in (first, second))
    value = b - a
    return value, value - math.hypot(b - low_b, high_a - a), value + math.hypot(high_b - b, a - low_a)


def sign_test(less: int, more: int) -> float:
    """Probability that chance alone makes a split of pairs at least as uneven (two-sided, exact); 1 without pairs."""
    count, fewer = less + more, min(less, more)
    tail = sum(math.comb(count, k) for k in range(fewer + 1))
    return min(1.0, 2.0 * tail / 2.0**count)
