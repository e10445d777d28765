"""Criteria by which local planners score velocities, one file each.

Critics with names from dwa_local_planner are the same as there; TrajectoryPlannerROS uses them with its own weights.
"""

from rosbot_patrol.planning.critics.alignment import AlignmentCritic
from rosbot_patrol.planning.critics.goal_distance import AttractionCritic, GoalDistanceCritic
from rosbot_patrol.planning.critics.goal_front import FacingGoalCritic, GoalFrontCritic
from rosbot_patrol.planning.critics.heading import HeadingCritic
from rosbot_patrol.planning.critics.obstacle import SUDDEN, Motion, ObstacleCritic, Surroundings
from rosbot_patrol.planning.critics.oscillation import OscillationCritic
from rosbot_patrol.planning.critics.path_distance import PathDistanceCritic
from rosbot_patrol.planning.critics.situation import Situation, distances_from, shrink
from rosbot_patrol.planning.critics.twirling import TwirlingCritic

__all__ = [
    "SUDDEN",
    "AlignmentCritic",
    "AttractionCritic",
    "FacingGoalCritic",
    "GoalDistanceCritic",
    "GoalFrontCritic",
    "HeadingCritic",
    "Motion",
    "ObstacleCritic",
    "OscillationCritic",
    "PathDistanceCritic",
    "Situation",
    "Surroundings",
    "TwirlingCritic",
    "distances_from",
    "shrink",
]
