"""Critic: distance of the trajectory's end from the local goal, where the plan leaves the local costmap."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.planning.critics.situation import Array, Situation


class GoalDistanceCritic:
    """Distance around obstacles from the trajectory's end to the local goal (MapGridCostFunction)."""

    def score(self, situation: Situation) -> Array:
        """Distances of the trajectories [m], shape (K,); inf where the local goal cannot be reached."""
        distances: Array = situation.to_goal[0]
        return distances


class AttractionCritic:
    """Squared straight distance to the local goal (TrajectoryPlannerROS with `simple_attractor`)."""

    def score(self, situation: Situation) -> Array:
        """Squared distances [m^2], shape (K,)."""
        off: Array = situation.ends[:, :2] - situation.plan[-1, :2]
        squares: Array = np.einsum("ij,ij->i", off, off)
        return squares
