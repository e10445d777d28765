"""Reachable cells of a costmap, and a sentence on why a cell is unreachable."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import LETHAL, UNKNOWN, CostCells
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.planning.global_planners.reach_kernels import flood

Cell = tuple[int, int]
_ANYWHERE = (-1, -1)
_ALL = -1
_BACK = {1: (-1, 0), 2: (1, 0), 3: (0, -1), 4: (0, 1)}


class Kind(IntEnum):
    """Class of a cell for a planner, the better ones first."""

    OPEN = 0
    UNKNOWN = 1
    NARROW = 2
    OBSTACLE = 3


WHY_OCCUPIED = {
    Kind.UNKNOWN: "lies in unknown space, and allow_unknown is false",
    Kind.NARROW: "is too near to an obstacle for the robot to stand there",
    Kind.OBSTACLE: "lies in an obstacle",
}
_WHAT = {
    Kind.UNKNOWN: "unknown space (allow_unknown is false)",
    Kind.NARROW: "a gap too narrow for the robot",
    Kind.OBSTACLE: "an obstacle",
}


def kinds_of_costs(prices: NDArray[np.float32]) -> NDArray[np.uint8]:
    """`Kind` of a cell by its cost, from the price of crossing it; both of shape (256,)."""
    kinds = np.full(256, Kind.NARROW, np.uint8)
    kinds[UNKNOWN], kinds[LETHAL] = Kind.UNKNOWN, Kind.OBSTACLE
    kinds[np.isfinite(prices)] = Kind.OPEN
    return kinds


def nearest_reachable(cells: CostCells, kinds: NDArray[np.uint8], start: Cell, goal: Cell, reach: int) -> Cell | None:
    """The open cell nearest to the goal, at most `reach` cells away, that is connected to the start."""
    came, _ = flood(cells, kinds, *start, *_ANYWHERE, Kind.OPEN, _ALL)
    x0, y0 = max(goal[0] - reach, 0), max(goal[1] - reach, 0)
    window = np.s_[y0 : max(goal[1] + reach + 1, 0), x0 : max(goal[0] + reach + 1, 0)]
    reached = (came[window] > 0) & (kinds[cells[window]] == Kind.OPEN)
    if not reached.any():
        return None
    dy, dx = np.ogrid[: reached.shape[0], : reached.shape[1]]
    d2 = np.where(reached, (dx + x0 - goal[0]) ** 2 + (dy + y0 - goal[1]) ** 2, np.iinfo(np.int64).max)
    iy, ix = np.unravel_index(int(np.argmin(d2)), d2.shape)
    return (x0 + int(ix), y0 + int(iy)) if d2[iy, ix] <= reach * reach else None


def why_no_way(info: GridInfo, cells: CostCells, kinds: NDArray[np.uint8], start: Cell, goal: Cell) -> str:
    """Reason for no path: which end is enclosed, by what and where; empty if neither is."""
    came, from_start = flood(cells, kinds, *start, *goal, Kind.OBSTACLE, _ALL)
    ix, iy = goal
    worst, place = Kind.OPEN, goal
    while came[iy, ix] in _BACK:
        kind = Kind(int(kinds[cells[iy, ix]]))
        if kind and kind >= worst:  # the last one stored is the first seen from the start
            worst, place = kind, (ix, iy)
        step = _BACK[int(came[iy, ix])]
        ix, iy = ix + step[0], iy + step[1]
    if worst is Kind.OPEN:
        return ""
    _, from_goal = flood(cells, kinds, *goal, *_ANYWHERE, Kind.OPEN, from_start)
    end = "start" if from_start <= from_goal else "goal"
    area = min(from_start, from_goal) * info.resolution**2
    size = f"{area:.0f}" if area >= 10.0 else f"{area:.2g}"
    x, y = info.centre_of(*place)
    return f"the {end} is shut in ({size} m2 are open around it); in the way: {_WHAT[worst]} at ({x:.2f}, {y:.2f})"
