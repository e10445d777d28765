"""Continuity of scan stamps and odometry: in order, late, or restarted.

A scan that arrives after a newer one (threads and networks under load cause that) is late and adds nothing. If it
counted as a clock set back, the motion since the last update would be lost. With the tutorial's 0.5 m and 1 rad between
updates that is enough to lose the robot.
"""

from __future__ import annotations

import enum
import logging
import math

from rosbot_patrol.geometry import Pose2D

log = logging.getLogger(__name__)

LATE_S = 1.0  # a scan older by more than this is not late: the clock was set back, or a bag restarted
JUMP_M, JUMP_SPEED = 1.0, 5.0  # odometry that moves farther than this and faster is a restart, not a motion


class Reading(enum.Enum):
    """Relation of a scan's stamp and odometry to the previous ones."""

    USUAL = enum.auto()
    LATE = enum.auto()
    RESTART = enum.auto()


class OdometryTrack:
    """Stores the newest scan's stamp and odometry.

    Attributes:
        last: odom_from_base at the newest scan, None before the first.
    """

    def __init__(self) -> None:
        self.last: Pose2D | None = None
        self._stamp = -math.inf

    def classify(self, stamp: float, odometry: Pose2D) -> Reading:
        """Classify a scan; call `follow` unless it is late.

        Args:
            stamp: of the scan [s].
            odometry: odom_from_base at that time.
        """
        elapsed = stamp - self._stamp
        if -LATE_S <= elapsed < 0.0:
            return Reading.LATE
        way = 0.0 if self.last is None else math.hypot(odometry.x - self.last.x, odometry.y - self.last.y)
        if way <= JUMP_M + JUMP_SPEED * max(elapsed, 0.0):  # a changed clock does not move the robot
            return Reading.USUAL
        if elapsed < 0.0:
            log.warning("time went back by %.3f s, and the odometry with it: going on from the last pose", -elapsed)
            return Reading.RESTART
        log.warning("the odometry jumped by %.2f m in %.2f s: taken as its restart, not as a motion", way, elapsed)
        return Reading.RESTART

    def follow(self, stamp: float, odometry: Pose2D) -> None:
        """Make this the newest scan."""
        self._stamp, self.last = stamp, odometry
