"""Own motion: whether the robot itself triggered a motion sensor.

A call is attributed to the robot only if the robot moved past that room within the last seconds, its detector and
camera worked the whole time, and nothing in view could be a person. The call is noted in the mission's record. A sensor
that still calls after the robot has left is followed: so a person who walks behind the robot is looked for as soon as
it has left.
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
    """Positions of the robot in the last seconds.

    Args:
        radius: distance from a room's point within which its sensor sees the robot [m].
        memory: longest delay of a sensor's call, including the fall of its output [s].
    """

    def __init__(self, radius: float, memory: float) -> None:
        self._radius = radius
        self._memory = memory
        self._samples: deque[_Sample] = deque()

    def see(self, now: float, pose: Pose2D | None, *, awake: bool) -> None:
        """Record the robot's position.

        Args:
            now: steady time [s].
            pose: in map, None if unknown.
            awake: detector and camera work.
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
        """Whether the robot itself explains a call of the room's sensor now."""
        near = [s for s in self._samples if now - s.at <= self._memory and self._is_near(room, s.pose)]
        return any(s.moved for s in near) and all(s.awake for s in near)

    def _is_near(self, room: Room, pose: Pose2D) -> bool:
        return distance(pose, room.pose) < self._radius


def _differs(a: Pose2D, b: Pose2D) -> bool:
    return distance(a, b) > LEAST_MOVE or abs(angle_difference(a.yaw, b.yaw)) > LEAST_TURN
