"""Search for the cheapest path over a cost grid without visiting most of a large one.

On a small grid the whole field of arrival times is solved. On a large one:

1. The grid of the cheapest cell of each block (`potential_kernels.BLOCK` cells wide) is solved from the goal. It gives
   the approximate distance of each block from the goal, and proves where no path exists.
2. The fine field is solved in a corridor around that grid's best path. This gives a path and its cost.
3. If the coarse field leaves open whether another path is cheaper by more than `SLACK`, the fine field is solved again
   in all blocks that such a path could pass. Those are the blocks where the time from the start plus the least time to
   the goal stays below that cost (the pruning of A*, Hart, Nilsson, Raphael 1968, with a bound from above).

The coarse field is no strict bound, because its paths bend at the centres of blocks; `_BENDS` and `_COARSE` allow for
that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import CostCells
from rosbot_patrol.planning.global_planners import descent_kernels
from rosbot_patrol.planning.global_planners import potential_kernels as kernels
from rosbot_patrol.planning.global_planners import straighten_kernels as straighten

Cell = tuple[int, int]
Point = tuple[float, float]
Times = NDArray[np.float32]
Points = NDArray[np.float64]
Descend = Callable[["Field", Point, Point], Points]

SLACK = 0.004  # paths that could be cheaper by at most this share are not searched
_STEP = 0.5  # cells between the points of a path, as upstream
_PULLS = 3
_PULL_WINDOW = 24
_SMOOTH = 4  # points on each side
_SMOOTH_PRICE = 1.003  # largest relative price of a stretch after smoothing
_SMOOTHINGS = 2
_WHOLE = 256 * 256  # grids up to this number of cells are solved as a whole
_CORRIDOR = 4  # blocks on each side of the coarse path
_COARSE = 0.99  # the coarse field against the fine one, in the open
_BENDS = 12.0  # blocks by which a coarse path may be longer, as it bends at their centres


@dataclass(frozen=True)
class Field:
    """Arrival times over a costmap: costs, prices by cost, and times; times are inf or unset where unknown."""

    cells: CostCells
    prices: NDArray[np.float32]
    times: Times


def descend_smoothly(field: Field, goal: Point, start: Point) -> Points:
    """Descend the gradient of a field and pull the path straight; start to goal, shape (N, 2), N = 0 if it fails."""
    points, arrived = descent_kernels.descend(field.times, *goal, *start, _STEP)
    if not arrived:
        return np.empty((0, 2))
    points = np.ascontiguousarray(points[::-1])
    for _ in range(_PULLS):
        points = straighten.pull(field.cells, field.prices, straighten.cut(points, 2.0 * _STEP), _PULL_WINDOW)
    points = straighten.cut(points, _STEP)
    for _ in range(_SMOOTHINGS):
        points = straighten.smooth(field.cells, field.prices, points, _SMOOTH, _SMOOTH_PRICE)
    return points


def descend_by_cells(field: Field, goal: Point, start: Point) -> Points:
    """Descend from cell to cell, in eight directions; start's cell to goal's, shape (N, 2), N = 0 if it fails."""
    shape = field.times.shape
    points, arrived = descent_kernels.descend_cells(
        field.times, *_nearest_cell(goal, shape), *_nearest_cell(start, shape)
    )
    return np.ascontiguousarray(points[::-1]) if arrived else np.empty((0, 2))


def find_way(
    cells: CostCells,
    prices: NDArray[np.float32],
    start: Point,
    goal: Point,
    descend: Descend = descend_smoothly,
) -> Points | None:
    """Find the cheapest path between two points; None if there is none.

    Args:
        cells: costs, shape (height, width).
        prices: price of crossing a cell, by its cost; inf if impassable; shape (256,).
        start: (x, y) in cells with centres at whole numbers, inside.
        goal: the same.
        descend: makes a path from a field of arrival times.

    Returns:
        Points (x, y) in cells from start to goal, shape (N, 2).
    """
    search = _Search(cells, prices, start, goal)
    if cells.size <= _WHOLE:
        field = search.field(np.full(search.blocks, np.inf, np.float32))
        return None if field is None else _points(descend(field, goal, start))
    return search.in_blocks(descend)


def _points(points: Points) -> Points | None:
    return points if len(points) else None


class _Search:
    def __init__(self, cells: CostCells, prices: NDArray[np.float32], start: Point, goal: Point) -> None:
        self.cells, self.prices = cells, prices
        self.start, self.goal = start, goal
        self.start_cell, self.goal_cell = _nearest_cell(start, cells.shape), _nearest_cell(goal, cells.shape)
        self.blocks = tuple(-(-n // kernels.BLOCK) for n in cells.shape)
        self.least_price = float(prices.min())

    def in_blocks(self, descend: Descend) -> Points | None:
        """Search in blocks, as the module's docstring describes."""
        far = self._times_to_goal()
        ix, iy = (i // kernels.BLOCK for i in self.start_cell)
        if not np.isfinite(far[iy, ix]):
            return None
        field = self.field(self._corridor(far))
        if field is None:  # a gap may be open block by block, but not cell by cell
            field = self.field(np.where(np.isfinite(far), np.float32(np.inf), np.float32(-1.0)))
            return None if field is None else _points(descend(field, self.goal, self.start))
        points = _points(descend(field, self.goal, self.start))
        worth_it = (1.0 - SLACK) * float(field.times[self.goal_cell[1], self.goal_cell[0]])
        del field
        limits = (worth_it - self._least_times(far)).astype(np.float32)
        if limits[iy, ix] < 0.0:
            return points
        better = self.field(limits)
        return points if better is None else _points(descend(better, self.goal, self.start))

    def field(self, limits: Times) -> Field | None:
        """Arrival times from the start up to the goal, within limits; None if the goal is not reached."""
        times = np.empty(self.cells.shape, np.float32)  # only touched pages take memory
        kernels.open_blocks(limits, times)
        source, zero = np.array([self.start_cell], np.int64), np.zeros(1, np.float32)
        found = kernels.propagate(self.cells, self.prices, source, zero, *self.goal_cell, limits, times)
        return Field(self.cells, self.prices, times) if found else None

    def _times_to_goal(self) -> Times:
        order = np.argsort(self.prices, kind="stable")
        rank = np.empty(256, np.uint8)
        rank[order] = np.arange(256)
        coarse = kernels.cheapest_of_blocks(self.cells, rank)
        times = np.full(coarse.shape, np.inf, np.float32)
        limits = np.full([-(-n // kernels.BLOCK) for n in coarse.shape], np.inf, np.float32)
        source = np.array([self.goal_cell], np.int64) // kernels.BLOCK
        prices = self.prices[order] * np.float32(kernels.BLOCK)
        kernels.propagate(coarse, prices, source, np.zeros(1, np.float32), -1, -1, limits, times)
        return times

    def _corridor(self, far: Times) -> Times:
        ends = [float(i // kernels.BLOCK) for cell in (self.start_cell, self.goal_cell) for i in cell]
        points, _ = descent_kernels.descend(far, ends[0], ends[1], ends[2], ends[3], 0.5)
        limits = np.full(far.shape, -1.0, np.float32)
        for x, y in np.unique(np.rint(points).astype(np.int64), axis=0):
            rows = slice(max(y - _CORRIDOR, 0), y + _CORRIDOR + 1)
            limits[rows, max(x - _CORRIDOR, 0) : x + _CORRIDOR + 1] = np.inf
        return limits

    def _least_times(self, far: Times) -> NDArray[np.float64]:
        """Lower bound of the time from each block to the goal."""
        size = kernels.BLOCK
        x, y = (np.arange(n) * size + (size - 1) / 2.0 for n in far.shape[::-1])
        gap = np.hypot((x - self.goal[0])[None, :], (y - self.goal[1])[:, None]) - 0.75 * size
        return np.maximum(_COARSE * far - _BENDS * size * self.least_price, gap * self.least_price)


def _nearest_cell(point: Point, shape: tuple[int, ...]) -> Cell:
    x, y = (min(max(math.floor(v + 0.5), 0), n - 1) for v, n in zip(point, shape[::-1], strict=True))
    return x, y
