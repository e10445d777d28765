"""How far a trajectory ends from the place where the plan leaves the local costmap."""

from __future__ import annotations

from rosbot_patrol.grid import cells_of_points
from rosbot_patrol.planning import critic_kernels as kernels
from rosbot_patrol.planning.critics.field import distance_field
from rosbot_patrol.planning.critics.situation import Array, Situation


class GoalDistanceCritic:
    """Distance around obstacles from the trajectory's end (and its nose) to the local goal [cells, coarse grid]."""

    def score(self, situation: Situation) -> Array:
        """Distances of the trajectories, shape (K,); inf where the local goal cannot be reached."""
        info = situation.coarse
        field = distance_field(info, situation.coarse_cells, cells_of_points(info, situation.plan[-1:, :2]))
        place = (info.resolution, info.origin_x, info.origin_y)
        return kernels.end_distances(situation.trajectories, field, *place, situation.nose)
