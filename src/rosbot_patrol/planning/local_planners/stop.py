"""Behaviour at the goal: stop, then turn to its heading (matches LatchedStopRotateController 1.17).

Differs: the turning speed per angle is twice upstream's, within the same limits, and it stops in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.errors import ControlError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, angle_difference
from rosbot_patrol.planning.critics import SUDDEN, Motion, ObstacleCritic
from rosbot_patrol.planning.interfaces import LocalView

_GAIN = 2.0  # turning speed per remaining angle [1/s]
_AHEAD = 0.5  # time ahead for which the turn is checked [s]


@dataclass(frozen=True, kw_only=True)
class StopLimits:
    """Limits at the goal: speeds [m/s, rad/s], accelerations, tolerance [rad] and the length of a cycle [s]."""

    yaw_tolerance: float
    slowest_turn: float
    fastest_left: float
    fastest_right: float
    accelerations: tuple[float, float, float]
    trans_stopped: float
    rot_stopped: float
    period: float

    def is_standing(self, velocity: Twist2D) -> bool:
        """Whether a velocity counts as zero."""
        return abs(velocity.wz) <= self.rot_stopped and math.hypot(velocity.vx, velocity.vy) <= self.trans_stopped


class StopAndTurn:
    """Stops the robot, then turns it to a heading."""

    def __init__(self, obstacles: ObstacleCritic) -> None:
        self._obstacles = obstacles
        self._is_turning = False

    def reset(self) -> None:
        """Stop before turning again."""
        self._is_turning = False

    def step(self, view: LocalView, goal: Pose2D, limits: StopLimits) -> Twist2D:
        """Velocity for this cycle, None when the robot has the heading.

        Raises:
            ControlError: something is in the way.
        """
        error = angle_difference(goal.yaw, view.pose.yaw)
        if abs(error) <= limits.yaw_tolerance:
            self._is_turning = False
            return STOP
        if not self._is_turning and math.hypot(view.velocity.vx, view.velocity.vy) > limits.trans_stopped:
            return self._stop(view, limits)
        self._is_turning = True
        return self._turn(view, error, limits)

    def _stop(self, view: LocalView, limits: StopLimits) -> Twist2D:
        v = view.velocity
        slower = [
            math.copysign(max(0.0, abs(speed) - acc * limits.period), speed)
            for speed, acc in zip(v, limits.accelerations, strict=True)
        ]
        twist = Twist2D(*slower)
        if twist == STOP or self._obstacles.is_free(view.costmap, view.pose, twist, _short(limits.period)):
            return twist
        return STOP

    def _turn(self, view: LocalView, error: float, limits: StopLimits) -> Twist2D:
        fastest = limits.fastest_left if error > 0.0 else limits.fastest_right
        acc = limits.accelerations[2]
        speed = min(fastest, math.sqrt(2.0 * acc * abs(error)), _GAIN * abs(error))
        speed = min(speed, abs(view.velocity.wz) + 2.0 * acc * limits.period)  # the measured velocity lags
        speed = min(max(speed, limits.slowest_turn), fastest)
        twist = Twist2D(0.0, 0.0, math.copysign(speed, error))
        ahead = _short(min(_AHEAD, abs(error) / max(speed, 1e-3)))
        if speed > 0.0 and not self._obstacles.is_free(view.costmap, view.pose, twist, ahead):
            raise ControlError("there is no room to turn to the goal's heading")
        return twist


def _short(horizon: float) -> Motion:
    return Motion(horizon=max(horizon, 1e-3), accelerations=SUDDEN)
