"""Whether a trajectory hits something, and how near it comes."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.planning import critic_kernels as kernels
from rosbot_patrol.planning.critics.situation import Array, Situation


class ObstacleCritic:
    """The highest cost that a trajectory's poses meet; inf where the footprint touches, is unknown or leaves the map.

    Args:
        footprint: the robot's padded outline.
        circumscribed_cost: a centre that costs less has its footprint free; 0 checks each outline.
    """

    def __init__(self, footprint: Footprint, *, resolution: float, circumscribed_cost: int) -> None:
        self._outline = footprint.outline(resolution * 0.7)
        self._free_below = circumscribed_cost

    def score(self, situation: Situation) -> Array:
        """Costs of the trajectories, shape (K,)."""
        grid = situation.costmap
        place = (grid.info.resolution, grid.info.origin_x, grid.info.origin_y)
        worst = kernels.worst_footprint_costs(
            situation.trajectories, grid.cells, *place, self._outline, self._free_below
        )
        return np.where(worst < 0.0, np.inf, worst)
