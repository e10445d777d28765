"""Global planner under the name navfn/NavfnROS (matches navfn 1.17 of the navigation stack).

As upstream, a cell costs COST_NEUTRAL + COST_FACTOR * its cost, inscribed and lethal cells cannot be crossed, unknown
ones only with `allow_unknown` (at the highest cost), the robot's own cell is taken as free, and a goal that cannot be
reached is replaced by the nearest point within `default_tolerance`.

Differs:
    - The field is an exact upwind solution, searched towards the goal, so plans are smoother and come sooner.
    - A robot that stands within the inscribed radius of an obstacle (localisation is not exact) still gets a plan
      that leads out of it; upstream finds none and the robot stays stuck.
    - Poses carry the heading of the path; upstream leaves all but the last at zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.costmap.costs import FREE, INSCRIBED, LETHAL, UNKNOWN, CostCells
from rosbot_patrol.errors import GoalOccupied, NoPath, OutOfBounds, PlanningError, StartOccupied
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.params import param
from rosbot_patrol.planning import potential_kernels as kernels
from rosbot_patrol.planning.interfaces import Array, GlobalPlanner

COST_NEUTRAL = 50.0
COST_FACTOR = 0.8
COST_HIGHEST = 253.0
_GUIDE = 0.7 * COST_NEUTRAL  # below the least cost: a field guided by all of it settles cells again and again
_NO_CELLS = -1


@dataclass(frozen=True, kw_only=True)
class NavfnParams:
    """Parameters of NavfnROS."""

    allow_unknown: bool = param(True, doc="plan through unknown cells")
    default_tolerance: float = param(0.0, unit="m", lo=0.0, doc="how far from the goal a plan may end")
    visualize_potential: bool = param(False, doc="accepted, has no effect")
    planner_window_x: float = param(0.0, unit="m", doc="accepted, has no effect (upstream's neither)")
    planner_window_y: float = param(0.0, unit="m", doc="accepted, has no effect (upstream's neither)")
    escape_radius: float = param(0.4, unit="m", lo=0.0, doc="how far a start near an obstacle may lead out; ours")


def crossing_costs(allow_unknown: bool) -> np.ndarray:
    """What crossing a cell costs, by its cost; inf where it cannot be crossed. Shape (256,), float32."""
    table = (COST_NEUTRAL + COST_FACTOR * np.arange(256)).clip(max=COST_HIGHEST).astype(np.float32)
    table[[INSCRIBED, LETHAL]] = np.inf
    table[UNKNOWN] = COST_HIGHEST if allow_unknown else np.inf
    return table


class NavfnPlanner(GlobalPlanner):
    """Shortest ways over the costs."""

    def __init__(self, params: NavfnParams | None = None) -> None:
        self.params = params or NavfnParams()
        self._table = crossing_costs(self.params.allow_unknown)
        self._times = np.empty((0, 0), np.float32)

    def plan(self, costmap: Grid, start: Pose2D, goal: Pose2D, *, tolerance: float | None = None) -> Array:
        """As `GlobalPlanner.plan`; `tolerance` replaces `default_tolerance`."""
        info, cells = costmap.info, costmap.cells
        start_cell = _cell_of("start", start, info)
        goal_cell = _cell_of("goal", goal, info)
        if cells[start_cell[1], start_cell[0]] == LETHAL:
            raise StartOccupied(start.x, start.y)
        self._open_start(cells, start_cell, info)
        reach = self.params.default_tolerance if tolerance is None else tolerance
        is_open = math.isfinite(self._table[cells[goal_cell[1], goal_cell[0]]])
        if is_open and self._search(cells, start_cell, goal_cell):
            return self._poses(info, start, goal, goal_cell)
        failure: PlanningError = (
            NoPath((start.x, start.y), (goal.x, goal.y)) if is_open else GoalOccupied(goal.x, goal.y)
        )
        if reach <= 0.0:
            raise failure
        self._search(cells, start_cell, None)
        near = self._nearest(info, goal_cell, reach)
        if near is None:
            raise failure
        x, y = info.centre_of(*near)
        return self._poses(info, start, Pose2D(x, y, goal.yaw), near)

    def _open_start(self, cells: CostCells, start: tuple[int, int], info: GridInfo) -> None:
        """Free the robot's cell; where it stands too near to an obstacle, let it out at the highest cost."""
        ix, iy = start
        if cells[iy, ix] == INSCRIBED:
            r = math.ceil(self.params.escape_radius / info.resolution)
            y0, x0 = max(iy - r, 0), max(ix - r, 0)
            area = cells[y0 : iy + r + 1, x0 : ix + r + 1]
            dy, dx = np.ogrid[y0 - iy : y0 - iy + area.shape[0], x0 - ix : x0 - ix + area.shape[1]]
            area[(area == INSCRIBED) & (dx * dx + dy * dy <= r * r)] = INSCRIBED - 1
        cells[iy, ix] = FREE

    def _search(self, cells: CostCells, start: tuple[int, int], goal: tuple[int, int] | None) -> bool:
        if self._times.shape != cells.shape:
            self._times = np.empty(cells.shape, np.float32)
        self._times.fill(np.inf)
        x, y = goal if goal is not None else (_NO_CELLS, _NO_CELLS)
        source = np.array([start], np.int64)
        guide = _GUIDE if goal is not None else 0.0
        found = kernels.propagate(cells, self._table, source, np.zeros(1, np.float32), x, y, guide, self._times)
        return bool(found)

    def _nearest(self, info: GridInfo, goal: tuple[int, int], reach: float) -> tuple[int, int] | None:
        r = int(reach / info.resolution)
        y0, x0 = max(goal[1] - r, 0), max(goal[0] - r, 0)
        area = self._times[y0 : goal[1] + r + 1, x0 : goal[0] + r + 1]
        dy, dx = np.ogrid[y0 - goal[1] : y0 - goal[1] + area.shape[0], x0 - goal[0] : x0 - goal[0] + area.shape[1]]
        d2 = np.where(np.isfinite(area), dx * dx + dy * dy, np.iinfo(np.int64).max)
        best = np.unravel_index(int(np.argmin(d2)), d2.shape)
        if d2[best] > r * r:
            return None
        return x0 + int(best[1]), y0 + int(best[0])

    def _poses(self, info: GridInfo, start: Pose2D, goal: Pose2D, goal_cell: tuple[int, int]) -> Array:
        """From the field to poses: down from the goal, turned round, with headings."""
        here = (
            (start.x - info.origin_x) / info.resolution - 0.5,
            (start.y - info.origin_y) / info.resolution - 0.5,
        )
        there = (float(goal_cell[0]), float(goal_cell[1]))
        points, arrived = kernels.descend(self._times, *there, *here, 0.5)
        if not arrived:
            raise NoPath((start.x, start.y), (goal.x, goal.y))
        cells = points[::-1]
        xy = (cells + 0.5) * info.resolution + (info.origin_x, info.origin_y)
        xy[-1] = goal.x, goal.y
        if len(xy) == 1:
            xy = np.array([[start.x, start.y], [goal.x, goal.y]])
        return with_headings(xy, goal.yaw)


def with_headings(points: Array, last_yaw: float) -> Array:
    """Points of shape (N, 2) as poses that look along the path; the last has the heading given."""
    poses = np.empty((len(points), 3))
    poses[:, :2] = points
    steps = np.diff(points, axis=0)
    poses[:-1, 2] = np.arctan2(steps[:, 1], steps[:, 0])
    poses[-1, 2] = last_yaw
    return poses


def _cell_of(what: str, pose: Pose2D, info: GridInfo) -> tuple[int, int]:
    if not (math.isfinite(pose.x) and math.isfinite(pose.y)) or not info.contains(pose.x, pose.y):
        raise OutOfBounds(what, pose.x, pose.y)
    return info.cell_of(pose.x, pose.y)
