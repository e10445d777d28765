"""How far a trajectory ends from the plan."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.grid import cells_of_points
from rosbot_patrol.planning import critic_kernels as kernels
from rosbot_patrol.planning.critics.field import distance_field
from rosbot_patrol.planning.critics.situation import Array, Situation


class PathDistanceCritic:
    """Distance around obstacles from the trajectory's end (and its nose) to the plan [cells of the coarse grid]."""

    def score(self, situation: Situation) -> Array:
        """Distances of the trajectories, shape (K,); inf where the plan cannot be reached."""
        info = situation.coarse
        sources = np.unique(cells_of_points(info, situation.plan[:, :2]), axis=0)
        field = distance_field(info, situation.coarse_cells, sources)
        place = (info.resolution, info.origin_x, info.origin_y)
        return kernels.end_distances(situation.trajectories, field, *place, situation.nose)
