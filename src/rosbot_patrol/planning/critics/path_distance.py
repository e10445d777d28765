"""How far a trajectory ends from the plan."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.costmap.costs import INSCRIBED
from rosbot_patrol.grid import cells_of_points
from rosbot_patrol.planning import critic_kernels as kernels
from rosbot_patrol.planning.critics.field import distance_field
from rosbot_patrol.planning.critics.situation import Array, Situation


class PathDistanceCritic:
    """Distance around obstacles from the trajectory's end (and its nose) to the plan [cells of the coarse grid]."""

    def score(self, situation: Situation) -> Array:
        """Distances of the trajectories, shape (K,); inf where the plan cannot be reached."""
        info = situation.coarse
        ix, iy = np.unique(cells_of_points(info, situation.plan[:, :2]), axis=0).T
        free = situation.coarse_cells[iy.clip(0, info.height - 1), ix.clip(0, info.width - 1)] < INSCRIBED
        sources = np.column_stack((ix[free], iy[free]))  # what leads through an obstacle must not pull into it
        field = distance_field(info, situation.coarse_cells, sources)
        place = (info.resolution, info.origin_x, info.origin_y)
        return kernels.end_distances(situation.trajectories, field, *place, situation.nose)
