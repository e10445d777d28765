"""Pictures of a camera that hangs: the same one again and again, while the robot moves on.

Whoever it shows would be placed anew from wherever the robot is by now, and floor that nobody saw would count as seen.
A camera without noise (a simulated one) sends the same picture of a still room while the robot stands: that one counts.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable

from rosbot_patrol.geometry import angle_difference, distance
from rosbot_patrol.patrol.records.inputs import Eye, Frame

MOVED = 0.05  # so far from where the picture was new, it is none of this place [m]
TURNED = 0.05  # likewise [rad]

log = logging.getLogger(__name__)


class FrozenCamera:
    """Leaves out what a camera that hangs shows."""

    def __init__(self) -> None:
        self._eye: Eye | None = None
        self._is_told = False

    def left(self, frames: Iterable[Frame]) -> tuple[Frame, ...]:
        """The frames that prove something, in order."""
        return tuple(frame for frame in frames if self._is_new(frame))

    def _is_new(self, frame: Frame) -> bool:
        if not frame.is_same:
            self._eye, self._is_told = frame.eye, False
            return True
        if self._eye is None or frame.eye is None or not _apart(self._eye, frame.eye):
            return True
        if not self._is_told:
            self._is_told = True
            log.warning("the camera shows the same picture though the robot moves: what it shows does not count")
        return False


def _apart(a: Eye, b: Eye) -> bool:
    return distance(a.pose, b.pose) > MOVED or abs(angle_difference(a.pose.yaw, b.pose.yaw)) > TURNED
