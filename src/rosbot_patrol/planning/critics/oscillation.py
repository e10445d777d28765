"""Critic: would the velocity undo the previous one again?"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, Twist2D, angle_difference
from rosbot_patrol.planning.critics.situation import Array

FORWARD, STRAFING, TURNING = 0, 1, 2


class OscillationCritic:
    """Forbid a direction that was given up for its opposite until the robot has moved (OscillationCostFunction).

    Each of forward, sideways and turning motion may change its sign once; then the new sign stays. Sideways motion and
    turning count only while the robot does not move forward.
    """

    def __init__(self) -> None:
        self._last = [0, 0, 0]  # sign of the last motion of each kind
        self._only = [0, 0, 0]  # the only sign allowed, 0: both
        self._since = Pose2D()

    def reset(self) -> None:
        """Forget all."""
        self._last, self._only = [0, 0, 0], [0, 0, 0]

    def forbidden(self, samples: Array) -> NDArray[np.bool_]:
        """Which velocities (vx, vy, wz), shape (K, 3), are forbidden now, shape (K,)."""
        out = np.zeros(len(samples), np.bool_)
        for axis, only in enumerate(self._only):
            if only:
                out |= samples[:, axis] * only < 0.0
        return out

    def remember(self, pose: Pose2D, twist: Twist2D, *, still: float, distance: float, angle: float) -> None:
        """Record the velocity that is driven.

        Args:
            pose: of the robot.
            twist: its velocity.
            still: forward speeds up to this do not count as moving [m/s].
            distance: motion after which all directions are allowed again [m].
            angle: turn after which they are [rad].
        """
        if self._note(twist, still):
            self._since = pose
        if any(self._only):
            moved = math.hypot(pose.x - self._since.x, pose.y - self._since.y)
            if moved > distance or abs(angle_difference(pose.yaw, self._since.yaw)) > angle:
                self.reset()

    def _note(self, twist: Twist2D, still: float) -> bool:
        reversed_now = False
        axes = (FORWARD, STRAFING, TURNING) if abs(twist.vx) <= still else (FORWARD,)
        for axis in axes:
            sign = int(np.sign(twist[axis]))
            if sign == 0:
                continue
            if self._last[axis] == -sign:
                self._only[axis] = sign
                reversed_now = True
            self._last[axis] = sign
        return reversed_now
