"""Base of both global planners: converts poses to cells, and a path of cells to poses.

An unusable start or goal raises an error with the reason. As upstream, the robot's own cell counts as free, and a goal
that cannot be reached is replaced by the nearest reachable point within the tolerance.

Differs from upstream:
    - A robot within the inscribed radius of an obstacle (localisation is not exact) still gets a plan that leads out;
      upstream finds none and the robot stays stuck.
    - If there is no plan, the error names the obstacle and its place.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import FREE, LETHAL, CostCells
from rosbot_patrol.errors import GoalOccupied, NoPath, OutOfBounds, PlanningError, StartOccupied
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.global_planners.obstacles import (
    WHY_OCCUPIED,
    Cell,
    Kind,
    kinds_of_costs,
    nearest_reachable,
    why_no_way,
)
from rosbot_patrol.planning.global_planners.search import Descend, descend_smoothly, find_way
from rosbot_patrol.planning.interfaces import Array, GlobalPlanner
from rosbot_patrol.tunable import changed

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = TypeVar("P", bound="DataclassInstance")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A planner's parameters, converted for planning.

    Attributes:
        prices: price of crossing a cell, by its cost; inf if impassable; shape (256,).
        tolerance: maximum distance of the plan's end from the goal [m], unless the request sets it.
        escape_radius: maximum distance that a start close to an obstacle may lead out [m].
        outline: treat the outermost cells of the costmap as obstacles.
        descend: makes a path from a field of arrival times.
        kinds: `Kind` of a cell by its cost, from the prices; shape (256,).
    """

    prices: NDArray[np.float32]
    tolerance: float
    escape_radius: float
    outline: bool = False
    descend: Descend = descend_smoothly
    kinds: NDArray[np.uint8] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "kinds", kinds_of_costs(self.prices))


class PotentialPlanner(GlobalPlanner, Generic[P]):
    """Finds the cheapest path over the costs; `tunable` names the parameters that can change at run time."""

    tunable: ClassVar[tuple[str, ...]] = ()

    def __init__(self, params: P) -> None:
        self.params = params
        self._settings = self._settings_of(params)

    @abstractmethod
    def _settings_of(self, params: P) -> Settings:
        """Convert parameters to settings."""

    def reconfigure(self, changes: Mapping[str, Any], *, name: str = "") -> P:
        """Change some of the parameters in `tunable`, as a dynamic_reconfigure server asks; returns all of them.

        A plan in progress is finished with the old parameters.

        Raises:
            ParamError: one is not tunable, of the wrong type or out of bounds; `name` is the prefix in its message.
        """
        self.params = changed(self.params, changes, self.tunable, name=name)
        self._settings = self._settings_of(self.params)
        return self.params

    @property
    def prices(self) -> NDArray[np.float32]:
        """Price of crossing a cell, by its cost; inf if impassable; shape (256,)."""
        return self._settings.prices

    @abstractmethod
    def _poses(self, points: Array, start: Pose2D, goal: Pose2D) -> Array:
        """Add headings to points of shape (N, 2), N > 1; poses of shape (N, 3), the last with the goal's heading."""

    def plan(self, costmap: Grid, start: Pose2D, goal: Pose2D, *, tolerance: float | None = None) -> Array:
        """As `GlobalPlanner.plan`; `tolerance` replaces the planner's own."""
        settings, info, cells = self._settings, costmap.info, costmap.cells
        reach = settings.tolerance if tolerance is None else tolerance
        start_cell = _cell_of("start", start, info)
        goal_cell = _cell_of("goal", goal, info, margin=reach)
        if cells[start_cell[1], start_cell[0]] == LETHAL:
            raise StartOccupied(start.x, start.y, WHY_OCCUPIED[Kind.OBSTACLE])
        if settings.outline:
            cells[[0, -1], :] = LETHAL
            cells[:, [0, -1]] = LETHAL
        _open_start(settings, cells, start_cell, info)
        failure = _occupied(settings, cells, info, goal, goal_cell)
        if failure is None:
            points = _way(settings, info, cells, start, goal)
            if points is not None:
                return self._finished(points, start, goal)
        near = None
        if reach > 0.0:
            near = nearest_reachable(cells, settings.kinds, start_cell, goal_cell, int(reach / info.resolution + 1e-9))
        if near is not None:
            end = Pose2D(*info.centre_of(*near), goal.yaw)
            points = _way(settings, info, cells, start, end)
            if points is not None:
                return self._finished(points, start, end)
        if failure is None:
            reason = why_no_way(info, cells, settings.kinds, start_cell, goal_cell)
            failure = NoPath((start.x, start.y), (goal.x, goal.y), reason)
        raise failure

    def _finished(self, points: Array, start: Pose2D, goal: Pose2D) -> Array:
        points[-1] = goal.x, goal.y
        if len(points) == 1:
            points = np.array([[start.x, start.y], [goal.x, goal.y]])
        return self._poses(points, start, goal)


def with_headings(points: Array, last_yaw: float) -> Array:
    """Poses along points of shape (N, 2), with headings along the path; the last has the given heading."""
    poses = np.empty((len(points), 3))
    poses[:, :2] = points
    steps = np.diff(points, axis=0)
    poses[:-1, 2] = np.arctan2(steps[:, 1], steps[:, 0])
    poses[-1, 2] = last_yaw
    return poses


def _cell_of(what: str, pose: Pose2D, info: GridInfo, *, margin: float = 0.0) -> Cell:
    """Cell of a pose, which may lie off the grid by a margin [m]."""
    if not (math.isfinite(pose.x) and math.isfinite(pose.y)):
        raise OutOfBounds(what, pose.x, pose.y)  # NaN is nowhere
    cell = info.cell_of(pose.x, pose.y)
    gaps = [max(-i, i - n + 1, 0) * info.resolution for i, n in zip(cell, (info.width, info.height), strict=True)]
    if math.hypot(*gaps) > margin:
        raise OutOfBounds(what, pose.x, pose.y, _covered(info))
    return cell


def _covered(info: GridInfo) -> tuple[float, float, float, float]:
    """Lowest and highest x and y of a grid [m]."""
    width, height = info.size
    return info.origin_x, info.origin_y, info.origin_x + width, info.origin_y + height


def _occupied(settings: Settings, cells: CostCells, info: GridInfo, goal: Pose2D, cell: Cell) -> PlanningError | None:
    if not info.contains_cell(*cell):
        return OutOfBounds("goal", goal.x, goal.y, _covered(info))
    kind = Kind(int(settings.kinds[cells[cell[1], cell[0]]]))
    return GoalOccupied(goal.x, goal.y, WHY_OCCUPIED[kind]) if kind else None


def _open_start(settings: Settings, cells: CostCells, start: Cell, info: GridInfo) -> None:
    """Free the robot's cell; if it stands too close to an obstacle, let it out at the highest cost."""
    ix, iy = start
    if settings.kinds[cells[iy, ix]] == Kind.NARROW:
        r = math.ceil(settings.escape_radius / info.resolution)
        y0, x0 = max(iy - r, 0), max(ix - r, 0)
        area = cells[y0 : iy + r + 1, x0 : ix + r + 1]
        dy, dx = np.ogrid[y0 - iy : y0 - iy + area.shape[0], x0 - ix : x0 - ix + area.shape[1]]
        dearest = int(np.flatnonzero(settings.kinds[:LETHAL] == Kind.OPEN)[-1])
        area[(settings.kinds[area] == Kind.NARROW) & (dx * dx + dy * dy <= r * r)] = dearest
    cells[iy, ix] = FREE


def _way(settings: Settings, info: GridInfo, cells: CostCells, start: Pose2D, goal: Pose2D) -> Array | None:
    """Path from the start to the goal: points [m], shape (N, 2)."""
    origin, resolution = np.array([info.origin_x, info.origin_y]), info.resolution
    ends = [tuple((np.array([pose.x, pose.y]) - origin) / resolution - 0.5) for pose in (start, goal)]
    points = find_way(cells, settings.prices, ends[0], ends[1], settings.descend)
    return None if points is None else (points + 0.5) * resolution + origin
