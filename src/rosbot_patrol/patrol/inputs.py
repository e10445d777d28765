"""What the patrol is told in each step, and what it answers: plain records."""

from __future__ import annotations

import math
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


@dataclass(frozen=True, kw_only=True)
class Box:
    """One object in one picture: class, probability, corners [px]."""

    label: str
    probability: float
    xmin: int
    ymin: int
    xmax: int
    ymax: int

    @property
    def width(self) -> int:
        """Width [px]."""
        return self.xmax - self.xmin

    @property
    def height(self) -> int:
        """Height [px]."""
        return self.ymax - self.ymin


@dataclass(frozen=True, kw_only=True)
class Frame:
    """What the detector saw in one picture.

    Attributes:
        stamp: when the picture was taken [s], None where that is not known (darknet_ros tells it only with boxes).
        boxes: nothing seen if empty.
    """

    stamp: float | None = None
    boxes: tuple[Box, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """One step's inputs.

    Attributes:
        wall: seconds since 1970, for ids and records only.
        triggers: rooms whose sensor saw motion since the last step, in order of arrival.
        frames: what the detector saw since the last step.
        yaw: heading of base_link in odom [rad], None where it is not known now.
        pose: of base_link in map, None where it is not known now.
        clearance: from the robot's centre to the nearest thing that the lidar sees [m], None where it is silent.
        link: the navigation.
        detector_at: when the detector was last heard [s].
        camera_at: when a picture came last that was not black [s].
        camera_changed_at: when one came last that differs from the one before [s], inf where nobody compares.
    """

    wall: float = 0.0
    triggers: tuple[int, ...] = ()
    frames: tuple[Frame, ...] = ()
    yaw: float | None = None
    pose: Pose2D | None = None
    clearance: float | None = None
    link: GoalLink = GoalLink()
    detector_at: float = -math.inf
    camera_at: float = -math.inf
    camera_changed_at: float = math.inf
