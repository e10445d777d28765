"""A goal that is sent to move_base, and what is known of its progress."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from rosbot_patrol.geometry import Pose2D


class GoalState(Enum):
    """How far the goal given last has come."""

    NONE = "none"
    ACTIVE = "active"
    SUCCEEDED = "succeeded"
    FAILED = "failed"


@dataclass(frozen=True, kw_only=True)
class GoalLink:
    """What is known of the navigation.

    Attributes:
        is_up: the action server answers.
        tag: of the goal that was sent last, "" before the first.
        state: of that goal.
        text: what the server said about it.
    """

    is_up: bool = False
    tag: str = ""
    state: GoalState = GoalState.NONE
    text: str = ""


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A pose in the frame `map` to drive to; the tag tells it from all others."""

    tag: str
    pose: Pose2D
