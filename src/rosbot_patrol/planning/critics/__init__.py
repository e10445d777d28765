"""What a local planner judges its trajectories by, one file each."""

from rosbot_patrol.planning.critics.goal_distance import GoalDistanceCritic
from rosbot_patrol.planning.critics.obstacle import ObstacleCritic
from rosbot_patrol.planning.critics.path_distance import PathDistanceCritic
from rosbot_patrol.planning.critics.situation import Situation

__all__ = ["GoalDistanceCritic", "ObstacleCritic", "PathDistanceCritic", "Situation"]
