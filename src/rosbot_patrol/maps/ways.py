"""Path lengths over a grid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]


def steps_over(wide: Mask, start: tuple[int, int]) -> Array:
    """Steps from a cell to every other over a mask, by waves over the whole grid: a diagonal counts 1.4.

    Args:
        wide: passable cells, shape (H, W).
        start: (ix, iy) of the cell to begin with.

    Returns:
        Path lengths [cells], inf if unreachable, shape (H, W).
    """
    out = np.full(wide.shape, math.inf)
    ix, iy = start
    out[iy, ix] = 0.0
    front: tuple[NDArray[np.int64], NDArray[np.int64]] = (np.array([iy]), np.array([ix]))
    steps = [(dy, dx, math.hypot(dy, dx)) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
    while len(front[0]):
        reached = []
        for dy, dx, length in steps:
            y, x = front[0] + dy, front[1] + dx
            gone = out[front] + length
            inside = (y >= 0) & (x >= 0) & (y < wide.shape[0]) & (x < wide.shape[1])
            y, x, gone = y[inside], x[inside], gone[inside]
            better = wide[y, x] & (gone < out[y, x] - 1e-9)
            y, x, gone = y[better], x[better], gone[better]
            np.minimum.at(out, (y, x), gone)
            reached.append(y * wide.shape[1] + x)
        cells = np.unique(np.concatenate(reached))
        front = cells // wide.shape[1], cells % wide.shape[1]
    return out
