"""A goal for move_base, and its progress."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from rosbot_patrol.geometry import Pose2D, distance


class GoalState(Enum):
    """Progress of the last goal."""

    NONE = "none"
    ACTIVE = "active"
    SUCCEEDED = "succeeded"
    FAILED = "failed"


# Statuses of actionlib_msgs/GoalStatus, which only ros/ can import.
_UNDER_WAY = {0, 1, 6, 7}  # PENDING, ACTIVE, PREEMPTING, RECALLING
_SUCCEEDED = 3
_ENDINGS = {
    2: "the goal was given up for another",  # PREEMPTED
    5: "the goal was rejected",
    8: "the goal was called back",  # RECALLED
    9: "the goal was lost",
}
_NEARER = 0.15  # decrease of the distance that counts as progress, and a move that ends a standstill [m]
SILENCE = 5.0  # time without a status after which the server of an action counts as down [s]


def goal_state(status: int) -> GoalState:
    """Tell how far a goal has come by its actionlib_msgs/GoalStatus."""
    if status in _UNDER_WAY:
        return GoalState.ACTIVE
    return GoalState.SUCCEEDED if status == _SUCCEEDED else GoalState.FAILED


def ending_text(status: int) -> str:
    """Say how a goal of this actionlib_msgs/GoalStatus ended, for a server that does not; "" if nothing is to say."""
    return _ENDINGS.get(status, "")


@dataclass(frozen=True, kw_only=True)
class GoalLink:
    """Connection to the navigation: is it up, and how is the last goal.

    Attributes:
        is_up: the action server answers.
        tag: of the last goal sent, "" before the first.
        state: of that goal.
        text: what the server said about it.
    """

    is_up: bool = False
    tag: str = ""
    state: GoalState = GoalState.NONE
    text: str = ""


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A pose in the frame `map` to drive to; the tag identifies it."""

    tag: str
    pose: Pose2D


class Standstill:
    """How long a robot has been about where it is, turning or not."""

    def __init__(self) -> None:
        self._at: Pose2D | None = None
        self._since = 0.0

    def lasts(self, now: float, pose: Pose2D) -> float:
        """Time about this place [s].

        Args:
            now: [s].
            pose: of the robot.
        """
        if self._at is None or distance(pose, self._at) > _NEARER:
            self._at, self._since = pose, now
        return now - self._since


class Progress:
    """How long a drive has brought the robot no nearer to its goal."""

    def __init__(self) -> None:
        self._best, self._since = math.inf, 0.0

    def stalled(self, now: float, gap: float) -> float:
        """Time without progress [s].

        Args:
            now: [s].
            gap: distance from the goal [m].
        """
        if gap < self._best - _NEARER:
            self._best, self._since = gap, now
        return now - self._since
