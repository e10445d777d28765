"""Critic: distance of the trajectory's end from the plan."""

from __future__ import annotations

from rosbot_patrol.planning.critics.situation import Array, Situation


class PathDistanceCritic:
    """Distance around obstacles from the trajectory's end to the plan (base_local_planner's MapGridCostFunction)."""

    def score(self, situation: Situation) -> Array:
        """Distances of the trajectories [m], shape (K,); inf where the plan cannot be reached."""
        distances: Array = situation.to_plan[0]
        return distances
