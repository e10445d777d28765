"""Interfaces of the navigator: plans, views, commands, outcomes, and upstream's result texts."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import PlanningError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.planning.interfaces import LocalView, RecoveryView

Array = NDArray[np.float64]


class State(enum.Enum):
    """State of the navigator."""

    IDLE = "idle"
    PLANNING = "planning"
    CONTROLLING = "controlling"
    CLEARING = "clearing"


class Reason(enum.Enum):
    """Why the robot does what it does; the value is the sentence for it if there is no better one."""

    NO_GOAL = "no goal"
    CANCELLED = "cancelled"
    ENDED = "the goal has ended"
    DEPARTED = "a program that the robot cannot drive without has gone"
    POSE_UNKNOWN = "the robot's pose is not known"
    NO_ODOMETRY = "there is no odometry"
    SENSORS_OLD = "sensor data is out of date"
    PLANNING = "planning"
    PLANNING_LONG = "planning takes long"
    NO_PLAN = "there is no plan"
    DRIVING = "driving"
    NO_CONTROL = "there is no safe velocity"
    WAITING = "waiting for somebody"
    RECOVERING = "recovering"
    RECOVERY = "a recovery behaviour runs"
    RECOVERED = "planning after a recovery"


class Trigger(enum.Enum):
    """Reason for a recovery, with upstream's result text if it fails."""

    PLANNING = "Failed to find a valid plan. Even after executing recovery behaviors."
    CONTROLLING = "Failed to find a valid control. Even after executing recovery behaviors."
    OSCILLATION = "Robot is oscillating. Even after executing recovery behaviors."


REACHED = "Goal reached."
BAD_QUATERNION = "Aborting on goal because it was sent with an invalid quaternion"
OFF_MAP = "The goal sent to the {} planner is off the global costmap. Planning will always fail to this goal."
PLAN_REFUSED = "Failed to pass global plan to the controller."


@dataclass(frozen=True)
class PlanResult:
    """A plan, shape (N, 3), or the reason why there is none."""

    poses: Array | None = None
    error: PlanningError | None = None


class PlanSource(Protocol):
    """Makes plans on request; at most one request is open."""

    def request(self, goal: Pose2D) -> None:
        """Start planning from the robot's pose."""

    def poll(self) -> PlanResult | None:
        """Take the result of the last request, once; None while planning, or without a request."""

    @property
    def is_busy(self) -> bool:
        """Whether a request is open."""

    def drop(self) -> None:
        """Forget the open request and its result."""


def _never(_twist: Twist2D) -> str:
    return ""


@dataclass(frozen=True, kw_only=True)
class NavigatorView:
    """Input of the navigator in one step.

    Attributes:
        local, recovery: views for the local planner and the recovery behaviours.
        is_current: whether the sensors can be trusted.
        must_wait: names the person for whom the robot must wait before it drives a velocity, "" for nobody.
    """

    local: LocalView
    recovery: RecoveryView
    is_current: bool = True
    must_wait: Callable[[Twist2D], str] = _never


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a goal."""

    succeeded: bool
    text: str


@dataclass(frozen=True, kw_only=True)
class Command:
    """Output of one step.

    Attributes:
        twist: velocity to send, None to send nothing.
        outcome: set when the goal has ended.
        plan: a new plan to show.
        recovery: index, count and name of a behaviour that has just begun.
        reason: why it does what it does.
        detail: the same in a sentence, "" if `reason` says all.
    """

    twist: Twist2D | None = None
    outcome: Outcome | None = None
    plan: Array | None = None
    recovery: tuple[int, int, str] | None = None
    reason: Reason
    detail: str = ""

    @property
    def text(self) -> str:
        """Why it does what it does, in a sentence."""
        return self.detail or self.reason.value
