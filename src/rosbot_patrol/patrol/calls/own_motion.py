"""Whether the robot itself is what a motion sensor sees.

A sensor's call is put down to the robot only where the robot moved past that room within the last seconds, its detector
and camera were awake the whole time, and nothing that could be a person is in view. The call is noted in the mission's
record. A sensor that still calls when the robot has gone on is followed: so somebody who walks behind the robot is
looked for as soon as it has left, and not taken for it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, angle_difference, distance
from rosbot_patrol.patrol.house.rooms import Room

PERIOD = 0.2  # [s] between samples
LEAST_MOVE = 0.01  # [m] in a period
LEAST_TURN = 0.02  # [rad] in a period


@dataclass(frozen=True)
class _Sample:
    at: float
    pose: Pose2D
    moved: bool
    awake: bool


class OwnMotion:
    """Where the robot was in the last seconds.

    Args:
        radius: so near to a room's point its sensor sees the robot [m].
        memory: how long a sensor's call may take to get here, and its output to fall again [s].
    """

    def __init__(self, radius: float, memory: float) -> None:
        self._radius = radius
        self._memory = memory
        self._samples: deque[_Sample] = deque()

    def see(self, now: float, pose: Pose2D | None, *, awake: bool) -> None:
        """Note where the robot is.

        Args:
            now: steady time [s].
            pose: in map, None where it is not known.
            awake: detector and camera speak.
        """
        last = self._samples[-1] if self._samples else None
        if last and now - last.at < PERIOD:
            if last.awake and not awake:
                self._samples[-1] = _Sample(last.at, last.pose, last.moved, awake)
            return
        if pose is None:
            return
        moved = last is not None and _differs(pose, last.pose)
        self._samples.append(_Sample(now, pose, moved, awake))
        while now - self._samples[0].at > self._memory:
            self._samples.popleft()

    def explains(self, room: Room, now: float) -> bool:
        """Whether a call of the room's sensor now is the robot's own doing."""
        near = [s for s in self._samples if now - s.at <= self._memory and self._is_near(room, s.pose)]
        return any(s.moved for s in near) and all(s.awake for s in near)

    def _is_near(self, room: Room, pose: Pose2D) -> bool:
        return distance(pose, room.pose) < self._radius


def _differs(a: Pose2D, b: Pose2D) -> bool:
    return distance(a, b) > LEAST_MOVE or abs(angle_difference(a.yaw, b.yaw)) > LEAST_TURN
