"""Inner loops that estimate the direction of walls from neighbouring beams."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]


@kernel()
def _gather(ends: Array, at: int, step: int, span: float, gap: float, sums: Array) -> int:
    """Add the ends up to `span` away on one side of a beam, but never across a gap; returns their number."""
    k, found = at, 0
    while True:
        following = k + step
        if following < 0 or following >= ends.shape[0]:
            return found
        u, v = ends[following, 0] - ends[at, 0], ends[following, 1] - ends[at, 1]
        if math.hypot(ends[following, 0] - ends[k, 0], ends[following, 1] - ends[k, 1]) > gap:
            return found
        if found > 0 and math.hypot(u, v) > span:
            return found
        sums[0] += u
        sums[1] += v
        sums[2] += u * u
        sums[3] += u * v
        sums[4] += v * v
        found += 1
        k = following


@kernel("void(float64[:, ::1], float64[::1], float64, float64, float64, float64[:, ::1])")
def find_normals(ends: Array, gaps: Array, span: float, straight: float, thin: float, out: Array) -> None:
    """Unit normals of the lines formed by neighbouring ends.

    Args:
        ends: of the beams that hit, in order [m], shape (K, 2).
        gaps: neighbours farther apart than this belong to two objects [m], shape (K,).
        span: distance to each side from which ends are used [m]; one neighbour always is.
        straight: largest spread across a line, relative to the spread along it.
        thin: largest spread across a line [m].
        out: filled with the normals, 0 without a line, shape (K, 2).
    """
    out[:] = 0.0
    sums = np.empty(5)
    for k in range(ends.shape[0]):
        sums[:] = 0.0
        before = _gather(ends, k, -1, span, gaps[k], sums)
        after = _gather(ends, k, 1, span, gaps[k], sums)
        if before == 0 or after == 0:
            continue
        n = before + after + 1
        a, c = sums[2] / n - (sums[0] / n) ** 2, sums[4] / n - (sums[1] / n) ** 2
        b = sums[3] / n - sums[0] * sums[1] / n**2
        mean, radius = 0.5 * (a + c), math.sqrt(0.25 * (a - c) ** 2 + b * b)
        if mean - radius > min(straight * straight * (mean + radius), thin * thin):
            continue
        along = 0.5 * math.atan2(2.0 * b, a - c)
        out[k, 0], out[k, 1] = -math.sin(along), math.cos(along)
