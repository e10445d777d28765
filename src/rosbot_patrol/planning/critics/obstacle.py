"""Whether a trajectory hits something, and how near it comes."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL, UNKNOWN
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.planning import critic_kernels as kernels
from rosbot_patrol.planning.critics.situation import Array, Situation


class ObstacleCritic:
    """The highest cost that a trajectory's poses meet; inf where the footprint touches, is unknown or leaves the map.

    A robot that touches something already may only move so that it touches less.

    Args:
        footprint: the robot's padded outline.
        resolution: of the local costmap [m].
        circumscribed_cost: a centre that costs less has its footprint free; 0 checks each outline.
    """

    def __init__(self, footprint: Footprint, *, resolution: float, circumscribed_cost: int) -> None:
        self._outline = footprint.outline(resolution * 0.7)
        self._free_below = circumscribed_cost

    def score(self, situation: Situation) -> Array:
        """Costs of the trajectories, shape (K,)."""
        return self.check(situation.trajectories, situation.costmap, situation.pose)

    def check(self, trajectories: Array, costmap: Grid, pose: Pose2D) -> Array:
        """Costs of trajectories that begin at a pose, shape (K,)."""
        info, cells = costmap.info, costmap.cells
        place = (info.resolution, info.origin_x, info.origin_y)
        touching = kernels.count_touching(cells, *place, self._outline, *pose)
        if touching:
            worst = kernels.leaving_costs(trajectories, cells, *place, self._outline, touching)
        else:
            # cells are coarse: a centre may stand in an inscribed one though the outline is free
            here = int(costmap.at(pose.x, pose.y)) if info.contains(pose.x, pose.y) else UNKNOWN
            taken_from = LETHAL if here == INSCRIBED else INSCRIBED
            worst = kernels.worst_footprint_costs(
                trajectories, cells, *place, self._outline, self._free_below, taken_from
            )
        return np.where(worst < 0.0, np.inf, worst)
