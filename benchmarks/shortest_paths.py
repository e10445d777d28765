"""Cheapest paths over a grid by another method than the planners': a fine graph, and paths pulled straight.

Points are (x, y) in cells, with centres at whole numbers. `prices[iy, ix]` is the price of a cell's length in that
cell, inf if it cannot be crossed. A path may touch the corner of a closed cell.
"""

from __future__ import annotations

import heapq
import math
from itertools import pairwise

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = [(1, 0), (1, 1), (2, 1), (3, 1), (3, 2)]
NEIGHBOURS = np.array(
    sorted({(sx * x, sy * y) for a, b in _STEPS for x, y in ((a, b), (b, a)) for sx in (-1, 1) for sy in (-1, 1)}),
    np.int64,
)


@numba.njit(nogil=True)
def segment_price(prices, x0, y0, x1, y1):
    """The price of a straight line, integrated exactly over the cells that it crosses (Amanatides and Woo 1987)."""
    height, width = prices.shape
    dx, dy = x1 - x0, y1 - y0
    length = math.hypot(dx, dy)
    ix, iy = math.floor(x0 + 0.5), math.floor(y0 + 0.5)
    # a start on an edge belongs to the cell that the line enters
    if dx < 0.0 and x0 + 0.5 == ix:
        ix -= 1
    if dy < 0.0 and y0 + 0.5 == iy:
        iy -= 1
    sx = 1 if dx > 0.0 else -1
    sy = 1 if dy > 0.0 else -1
    tx = (ix + 0.5 * sx - x0) / dx if dx != 0.0 else np.inf
    ty = (iy + 0.5 * sy - y0) / dy if dy != 0.0 else np.inf
    step_x = abs(1.0 / dx) if dx != 0.0 else np.inf
    step_y = abs(1.0 / dy) if dy != 0.0 else np.inf
    t, total = 0.0, 0.0
    while True:
        if ix < 0 or iy < 0 or ix >= width or iy >= height:
            return np.inf
        leave = min(min(tx, ty), 1.0)
        if leave > t + 1e-12:
            total += (leave - t) * length * prices[iy, ix]
            if not math.isfinite(total):
                return np.inf
        t = leave
        if leave >= 1.0 - 1e-12:
            return total
        if abs(tx - ty) < 1e-12:  # through a corner: not between two closed cells
            if not (math.isfinite(prices[iy, ix + sx]) or math.isfinite(prices[iy + sy, ix])):
                return np.inf
            ix, iy, tx, ty = ix + sx, iy + sy, tx + step_x, ty + step_y
        elif tx < ty:
            ix, tx = ix + sx, tx + step_x
        else:
            iy, ty = iy + sy, ty + step_y


@numba.njit(nogil=True)
def path_price(prices, points):
    """The price of a polyline of shape (N, 2)."""
    total = 0.0
    for i in range(len(points) - 1):
        total += segment_price(prices, points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1])
    return total


@numba.njit(nogil=True)
def _spread(prices, neighbours, start_x, start_y):
    height, width = prices.shape
    least = np.full((height, width), np.inf)
    came = np.full((height, width), -1, np.int32)
    least[start_y, start_x] = 0.0
    heap = [(0.0, np.int64(start_y * width + start_x))]
    while len(heap):
        price, cell = heapq.heappop(heap)
        cy, cx = cell // width, cell % width
        if price > least[cy, cx]:
            continue
        for k in range(len(neighbours)):
            nx, ny = cx + neighbours[k, 0], cy + neighbours[k, 1]
            if nx < 0 or ny < 0 or nx >= width or ny >= height or not math.isfinite(prices[ny, nx]):
                continue
            if least[ny, nx] <= price:
                continue
            found = price + segment_price(prices, float(cx), float(cy), float(nx), float(ny))
            if found < least[ny, nx]:
                least[ny, nx] = found
                came[ny, nx] = k
                heapq.heappush(heap, (found, np.int64(ny * width + nx)))
    return least, came


@numba.njit(nogil=True)
def _pull(prices, points, window):
    """Find the cheapest chain of straight lines over some of the points, in their order; true for kept points."""
    n = len(points)
    least = np.full(n, np.inf)
    before = np.full(n, -1, np.int64)
    least[0] = 0.0
    for i in range(1, n):
        for j in range(max(i - window, 0), i):
            if math.isfinite(least[j]) and least[j] < least[i]:
                found = least[j] + segment_price(prices, points[j, 0], points[j, 1], points[i, 0], points[i, 1])
                if found < least[i]:
                    least[i], before[i] = found, j
    kept = np.zeros(n, np.bool_)
    i = n - 1
    while i >= 0:
        kept[i] = True
        i = before[i]
    return kept


def spread(prices: Array, start: tuple[int, int]) -> tuple[Array, NDArray[np.int32]]:
    """Least price to each cell over the graph of 32 neighbours, and the neighbour used; shape of `prices` each."""
    found: tuple[Array, NDArray[np.int32]] = _spread(prices, NEIGHBOURS, *start)
    return found


def path_to(came: NDArray[np.int32], goal: tuple[int, int]) -> Array:
    """The path to a cell, from the result of `spread`; shape (N, 2)."""
    ix, iy = goal
    points = [(ix, iy)]
    while came[iy, ix] >= 0:
        dx, dy = NEIGHBOURS[came[iy, ix]]
        ix, iy = ix - int(dx), iy - int(dy)
        points.append((ix, iy))
    return np.array(points[::-1], np.float64)


def pulled_straight(prices: Array, points: Array, *, window: int = 150, rounds: int = 3) -> Array:
    """Make a path cheaper by straight lines between its points; returns the kept points, shape (N, 2).

    Between the rounds long lines are cut into pieces of two cells, so that lines can begin in their middle.
    """
    for _ in range(rounds):
        points = _cut(points)
        points = points[_pull(prices, points, window)]
    return points


def _cut(points: Array) -> Array:
    pieces = []
    for a, b in pairwise(points):
        count = max(1, math.ceil(math.dist(a, b) / 2.0))
        pieces.append(a + np.arange(count)[:, None] / count * (b - a))
    return np.concatenate([*pieces, points[-1:]])
