"""Inner loops of the search for a place: branch and bound over a pyramid of maxima.

Hess, Kohler, Rapp, Andor: Real-time loop closure in 2D LIDAR SLAM (2016).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Field = NDArray[np.uint8]
Offsets = NDArray[np.int32]


@kernel("void(uint8[:, :, ::1])")
def fill_pyramid(levels: Field) -> None:
    """Fill level h of a field with the maxima over 2**h x 2**h cells from each cell on; level 0 is given.

    `levels` has shape (L, H, W).
    """
    for level in range(1, levels.shape[0]):
        half = 1 << (level - 1)
        for y in range(levels.shape[1]):
            y2 = min(y + half, levels.shape[1] - 1)
            for x in range(levels.shape[2]):
                x2 = min(x + half, levels.shape[2] - 1)
                levels[level, y, x] = max(
                    max(levels[level - 1, y, x], levels[level - 1, y, x2]),
                    max(levels[level - 1, y2, x], levels[level - 1, y2, x2]),
                )


@kernel()
def sum_at(field: Field, points: Offsets, dx: int, dy: int) -> int:
    """Sum of a field over points, shape (P, 2), moved by (dx, dy) cells; 0 outside."""
    total = 0
    for k in range(points.shape[0]):
        x, y = points[k, 0] + dx, points[k, 1] + dy
        if x >= 0 and y >= 0 and x < field.shape[1] and y < field.shape[0]:
            total += field[y, x]
    return total


@kernel("void(uint8[:, :, ::1], int32[:, :, ::1], int64, int64, int64[::1])")
def find_best(levels: Field, turned: Offsets, reach: int, least: int, best: NDArray[np.int64]) -> None:
    """Find the turn and the shift of points with the largest sum over a field.

    Args:
        levels: the field and its maxima, shape (L, H, W).
        turned: the points in cells, once for each turn, shape (A, P, 2).
        reach: largest shift in x and y [cells].
        least: sums up to this are not looked for.
        best: filled with the turn's index (-1 if there is none), the shift in x and y [cells] and the sum, shape (4,).
    """
    top = levels.shape[0] - 1
    size = 1 << top
    side = (2 * reach + size) // size
    count = turned.shape[0] * side * side
    sums = np.empty(count, dtype=np.int64)
    for a in range(turned.shape[0]):
        for v in range(side):
            for u in range(side):
                sums[(a * side + v) * side + u] = sum_at(levels[top], turned[a], u * size - reach, v * size - reach)
    best[0], best[3] = -1, least
    stack = np.empty((4 * (top + 1), 4), dtype=np.int64)  # level, dx, dy, bound
    for start in np.argsort(-sums):
        if sums[start] <= best[3]:
            break
        a, rest = start // (side * side), start % (side * side)
        stack[0, 0], stack[0, 1], stack[0, 2] = top, (rest % side) * size - reach, (rest // side) * size - reach
        stack[0, 3] = sums[start]
        depth = 1
        while depth > 0:
            depth -= 1
            level, dx, dy, bound = stack[depth, 0], stack[depth, 1], stack[depth, 2], stack[depth, 3]
            if bound <= best[3]:
                continue
            if level == 0:
                if abs(dx) <= reach and abs(dy) <= reach:
                    best[0], best[1], best[2], best[3] = a, dx, dy, bound
                continue
            half = 1 << (level - 1)
            for k in range(4):
                x, y = dx + half * (k & 1), dy + half * (k >> 1)
                found = sum_at(levels[level - 1], turned[a], x, y)
                if found > best[3]:
                    stack[depth, 0], stack[depth, 1], stack[depth, 2], stack[depth, 3] = level - 1, x, y, found
                    depth += 1
