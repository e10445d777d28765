"""Critic: does the robot's nose end towards the local goal?"""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.costmap.costs import INSCRIBED
from rosbot_patrol.planning.critics.situation import Array, Situation, distances_from


class FacingGoalCritic:
    """Distance to the local goal from a point ahead of the trajectory's end (of TrajectoryPlannerROS)."""

    def score(self, situation: Situation) -> Array:
        """Distances of the noses [m], shape (K,)."""
        distances: Array = situation.to_goal[1]
        return distances


class GoalFrontCritic:
    """Distance to the local goal, shifted away by the same length (dwa_local_planner's goal_front costs).

    Differs: if the shifted goal would lie in an obstacle or off the costmap, it is shifted only as far as is free.
    """

    def score(self, situation: Situation) -> Array:
        """Distances of the noses [m], shape (K,)."""
        info, goal = situation.coarse.info, situation.plan[-1]
        angle = math.atan2(goal[1] - situation.pose.y, goal[0] - situation.pose.x)
        front = (goal[0], goal[1])
        for shift in np.linspace(0.0, situation.nose, max(2, math.ceil(situation.nose / info.resolution) + 1))[1:]:
            x, y = goal[0] + shift * math.cos(angle), goal[1] + shift * math.sin(angle)
            if not info.contains(x, y) or situation.coarse.at(x, y) >= INSCRIBED:
                break
            front = (x, y)
        distances: Array = situation.read(distances_from(situation.coarse, np.array([front])))[1]
        return distances
