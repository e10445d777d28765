"""Inner loop: exact bounded Euclidean distance to the nearest marked cell (Felzenszwalb and Huttenlocher 2012)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel("float32[:, ::1](boolean[:, ::1], int64)")
def bounded_distances(marked: NDArray[np.bool_], bound: int) -> NDArray[np.float32]:
    """Distance from each cell to the nearest marked one [cells], at most `bound`; shape as `marked`.

    First along the columns, by one sweep up and one down over whole rows. Then along each row, by the lower envelope of
    the parabolas given by the column distances.
    """
    height, width = marked.shape
    column = np.empty((height, width), dtype=np.int32)
    for x in range(width):
        column[0, x] = 0 if marked[0, x] else bound
    for y in range(1, height):
        for x in range(width):
            column[y, x] = 0 if marked[y, x] else min(column[y - 1, x] + 1, bound)
    for y in range(height - 2, -1, -1):
        for x in range(width):
            column[y, x] = min(column[y, x], column[y + 1, x] + 1)

    out = np.empty((height, width), dtype=np.float32)
    apex = np.empty(width, dtype=np.int64)  # x of each parabola of the envelope
    start = np.empty(width + 1, dtype=np.float64)  # where it becomes the lowest
    for y in range(height):
        count = 0
        for x in range(width):
            depth = column[y, x]
            if depth >= bound:
                continue
            level = depth * depth + x * x
            begin = -np.inf
            while count > 0:
                last = apex[count - 1]
                below = column[y, last]
                begin = (level - (below * below + last * last)) / (2.0 * (x - last))
                if begin > start[count - 1]:
                    break
                count -= 1
                begin = -np.inf
            apex[count] = x
            start[count] = begin
            count += 1
        if count == 0:
            out[y, :] = bound
            continue
        at = 0
        for x in range(width):
            while at + 1 < count and start[at + 1] < x:
                at += 1
            across = x - apex[at]
            depth = column[y, apex[at]]
            out[y, x] = min(np.sqrt(float(across * across + depth * depth)), float(bound))
    return out
