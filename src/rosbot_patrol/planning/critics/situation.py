"""Input of all critics in one control cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import INSCRIBED
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo, cells_of_points
from rosbot_patrol.planning.critics import critic_kernels as kernels

Array = NDArray[np.float64]

COARSE = 0.05  # edge of the cells of distance fields [m]


def shrink(costmap: Grid) -> Grid:
    """Highest costs of blocks of about 5 cm, the grid of the distance fields."""
    info = costmap.info
    factor = max(1, round(COARSE / info.resolution))
    if factor == 1:
        return costmap
    cells = kernels.shrink(costmap.cells, factor)
    coarse = GridInfo(
        resolution=info.resolution * factor,
        width=cells.shape[1],
        height=cells.shape[0],
        origin_x=info.origin_x,
        origin_y=info.origin_y,
    )
    return Grid(coarse, cells)


def distances_from(grid: Grid, points: Array) -> NDArray[np.float32]:
    """Distance to the nearest of some points, around impassable cells [cells]; inf if there is no path."""
    info = grid.info
    return kernels.spread(grid.cells, (points - (info.origin_x, info.origin_y)) / info.resolution)


@dataclass(frozen=True, kw_only=True)
class Situation:
    """One control cycle; distance fields shared by critics are computed when first needed.

    Attributes:
        pose: of the robot.
        samples: velocities (vx, vy, wz) to score, shape (K, 3).
        ends: their final poses in the local costmap's frame, shape (K, 3).
        coarse: the local costs in cells of about 5 cm.
        plan: the part of the plan that is followed, shape (N, 3).
        nose: distance ahead of a pose at which alignment is scored [m].
        goal_field: distance to the local goal, the plan's last pose [cells of the coarse grid].
    """

    pose: Pose2D
    samples: Array
    ends: Array
    coarse: Grid
    plan: Array
    nose: float
    goal_field: NDArray[np.float32]

    def read(self, field: NDArray[np.float32]) -> Array:
        """Distances of the ends and of the points `nose` ahead of them in a field [m], shape (2, K); inf: no path."""
        info = self.coarse.info
        found = kernels.end_distances(self.ends, field, info.resolution, info.origin_x, info.origin_y, self.nose)
        return info.resolution * found

    @cached_property
    def to_plan(self) -> Array:
        """Distance to the plan from ends and noses [m], shape (2, K)."""
        info = self.coarse.info
        ix, iy = cells_of_points(info, self.plan[:, :2]).T
        # the pull of the plan must not lead into an obstacle
        free = self.coarse.cells[iy.clip(0, info.height - 1), ix.clip(0, info.width - 1)] < INSCRIBED
        return self.read(distances_from(self.coarse, self.plan[free, :2]))

    @cached_property
    def to_goal(self) -> Array:
        """Distance to the local goal from ends and noses [m], shape (2, K); exact near it, where cells are coarse."""
        found = self.read(self.goal_field)
        x, y, yaw = self.ends.T
        noses = (x + self.nose * np.cos(yaw), y + self.nose * np.sin(yaw))
        exact = np.array([np.hypot(px - self.plan[-1, 0], py - self.plan[-1, 1]) for px, py in ((x, y), noses)])
        by_field = np.clip(found / self.coarse.info.resolution - 2.0, 0.0, 1.0)
        with np.errstate(invalid="ignore"):  # an infinite distance stays so
            return np.where(by_field == 1.0, found, by_field * found + (1.0 - by_field) * exact)

    @cached_property
    def goal_distance(self) -> float:
        """Straight distance from the robot to the local goal [m]."""
        return math.hypot(self.plan[-1, 0] - self.pose.x, self.plan[-1, 1] - self.pose.y)
