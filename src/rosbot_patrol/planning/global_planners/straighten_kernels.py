"""Inner loops that make a path over a cost grid cheaper and smoother.

The first-order field is a few per cent off around corners and where costs change within a few cells. A path that
descends it is therefore one or two per cent too expensive. Pulling it straight, at the exact price of each line,
corrects that. Points are (x, y) in cells, with centres at whole numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel("float64(uint8[:, ::1], float32[::1], float64, float64, float64, float64)")
def line_price(
    costs: NDArray[np.uint8], table: NDArray[np.float32], x0: float, y0: float, x1: float, y1: float
) -> float:
    """Exact price of a straight line, cell by cell (Amanatides and Woo 1987); inf if it is blocked.

    A line that passes the corner of an impassable cell is blocked, too.
    """
    height, width = costs.shape
    dx, dy = x1 - x0, y1 - y0
    ix, iy = math.floor(x0 + 0.5), math.floor(y0 + 0.5)
    end_x, end_y = math.floor(x1 + 0.5), math.floor(y1 + 0.5)
    if min(ix, end_x) < 0 or min(iy, end_y) < 0 or max(ix, end_x) >= width or max(iy, end_y) >= height:
        return np.inf
    sx = 1 if dx > 0.0 else -1
    sy = 1 if dy > 0.0 else -1
    left = abs(end_x - ix) + abs(end_y - iy)  # edges left to cross
    step_x = abs(1.0 / dx) if end_x != ix else np.inf
    step_y = abs(1.0 / dy) if end_y != iy else np.inf
    tx = (ix + 0.5 * sx - x0) / dx if end_x != ix else np.inf
    ty = (iy + 0.5 * sy - y0) / dy if end_y != iy else np.inf
    t, total = 0.0, 0.0
    price = float(table[costs[iy, ix]])
    while left > 0:
        corner = abs(tx - ty) < 1e-9 and ix != end_x and iy != end_y
        leave = min(tx, ty)
        total += (leave - t) * price
        t = leave
        if corner:
            if not (math.isfinite(table[costs[iy, ix + sx]]) and math.isfinite(table[costs[iy + sy, ix]])):
                return np.inf
            ix, iy, tx, ty = ix + sx, iy + sy, tx + step_x, ty + step_y
            left -= 2
        elif (tx < ty and ix != end_x) or iy == end_y:
            ix, tx = ix + sx, tx + step_x
            left -= 1
        else:
            iy, ty = iy + sy, ty + step_y
            left -= 1
        price = float(table[costs[iy, ix]])
        if not math.isfinite(price):
            return np.inf
    total += (1.0 - t) * price
    return total * math.hypot(dx, dy)


@kernel("float64[:, ::1](uint8[:, ::1], float32[::1], float64[:, ::1], int64)")
def pull(
    costs: NDArray[np.uint8], table: NDArray[np.float32], points: NDArray[np.float64], window: int
) -> NDArray[np.float64]:
    """Find the cheapest chain of straight lines between points of a path, none over more than `window` points.

    Args:
        costs: cost of each cell.
        table: price of a cell's length by its cost, shape (256,).
        points: the path, shape (N, 2), N > 0.
        window: maximum number of points that a line may skip.

    Returns:
        The points kept, shape (M, 2), with the first and the last; all points if the path is blocked.
    """
    n = points.shape[0]
    least = np.full(n, np.inf)
    before = np.full(n, -1, np.int64)
    least[0] = 0.0
    for i in range(1, n):
        for j in range(max(i - window, 0), i):
            # no price is below the least one, that of a free cell
            gap = math.hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1])
            if least[j] + gap * table[0] >= least[i]:
                continue
            found = least[j] + line_price(costs, table, points[j, 0], points[j, 1], points[i, 0], points[i, 1])
            if found < least[i]:
                least[i], before[i] = found, j
    if not math.isfinite(least[n - 1]):
        return points.copy()
    kept = np.empty(n, np.int64)
    count, i = 0, n - 1
    while i >= 0:
        kept[count] = i
        count += 1
        i = before[i]
    out = np.empty((count, 2))
    for k in range(count):
        out[k] = points[kept[count - 1 - k]]
    return out


@kernel("float64[:, ::1](float64[:, ::1], float64)")
def cut(points: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points about `step` apart along a polyline of shape (N, 2), N > 0, including its corners."""
    count = 1
    for i in range(points.shape[0] - 1):
        gap = math.hypot(points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1])
        count += max(1, math.ceil(gap / step - 1e-6))
    out = np.empty((count, 2))
    k = 0
    for i in range(points.shape[0] - 1):
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        pieces = max(1, math.ceil(math.hypot(dx, dy) / step - 1e-6))
        for j in range(pieces):
            out[k, 0] = points[i, 0] + dx * j / pieces
            out[k, 1] = points[i, 1] + dy * j / pieces
            k += 1
    out[k] = points[points.shape[0] - 1]
    return out


@kernel("float64[:, ::1](uint8[:, ::1], float32[::1], float64[:, ::1], int64, float64)")
def smooth(
    costs: NDArray[np.uint8], table: NDArray[np.float32], points: NDArray[np.float64], reach: int, most: float
) -> NDArray[np.float64]:
    """Move each point to the mean of its neighbours, fewer of them if the path would become more expensive.

    Args:
        costs: cost of each cell.
        table: price of a cell's length by its cost, shape (256,).
        points: a passable path, evenly spaced, shape (N, 2).
        reach: points on each side at most; the ends stay.
        most: accepted price of a stretch, relative to its price before.

    Returns:
        The path, shape (N, 2).
    """
    n = points.shape[0]
    side = np.empty(n, np.int64)
    for i in range(n):
        side[i] = min(reach, min(i, n - 1 - i))
    out = points.copy()
    before = np.zeros(n)
    for i in range(1, n):
        before[i] = before[i - 1] + line_price(
            costs, table, points[i - 1, 0], points[i - 1, 1], points[i, 0], points[i, 1]
        )
    after = np.zeros(n)
    bad = 1
    while bad > 0:
        for i in range(n):
            r = side[i]
            x, y = 0.0, 0.0
            for j in range(i - r, i + r + 1):
                x += points[j, 0]
                y += points[j, 1]
            out[i, 0], out[i, 1] = x / (2 * r + 1), y / (2 * r + 1)
        for i in range(1, n):
            after[i] = line_price(costs, table, out[i - 1, 0], out[i - 1, 1], out[i, 0], out[i, 1])
        bad = 0
        for i in range(n):
            a, b = max(i - reach, 0), min(i + reach, n - 1)
            price = 0.0
            for j in range(a + 1, b + 1):
                price += after[j]
            if price > most * (before[b] - before[a]) and side[i] > 0:
                side[i] -= 1
                bad += 1
    return out
