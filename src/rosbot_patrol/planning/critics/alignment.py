"""Critic: does the robot's nose end on the plan?"""

from __future__ import annotations

from rosbot_patrol.planning.critics.situation import Array, Situation


class AlignmentCritic:
    """Distance to the plan from a point ahead of the trajectory's end (dwa_local_planner's alignment costs)."""

    def score(self, situation: Situation) -> Array:
        """Distances of the noses [m], shape (K,); inf where the trajectory's end cannot reach the plan."""
        distances: Array = situation.to_plan[1]
        return distances
