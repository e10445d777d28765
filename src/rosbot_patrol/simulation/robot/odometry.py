"""Wheel-encoder odometry: counts ticks, with small errors of the assumed wheel radius and track."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class OdometryParams:
    """Resolution of the encoders, and calibration errors of the base."""

    ticks_per_turn: float = param(1024.0, lo=1.0, doc="encoder ticks per turn of a wheel")
    radius_error: float = param(0.004, lo=-0.5, hi=0.5, doc="relative error of the wheel radius in odometry")
    radius_difference: float = param(
        0.0, lo=-0.5, hi=0.5, doc="relative excess of the right wheels' radius over the left, unknown to odometry"
    )
    track_error: float = param(-0.002, lo=-0.5, hi=0.5, doc="relative error of the track width in odometry")


class EncoderOdometry:
    """Dead reckoning from the angles of the left and right wheels."""

    def __init__(self, params: OdometryParams, wheel_radius: float, track: float) -> None:
        self._tick = math.tau / params.ticks_per_turn
        radius = wheel_radius * (1.0 + params.radius_error)
        # Odometry's assumed radii against the true ones: a larger right wheel is assumed too small.
        self._radii = radius * (1.0 + params.radius_difference / 2.0), radius * (1.0 - params.radius_difference / 2.0)
        self._track = track * (1.0 + params.track_error)
        self._ticks = (0, 0)
        self._time = 0.0
        self.pose = Pose2D()
        self.twist = Twist2D()

    def update(self, left: float, right: float, now: float) -> None:
        """Update with the angles of the wheels [rad] at a time [s]."""
        ticks = (math.floor(left / self._tick), math.floor(right / self._tick))
        travel_left = (ticks[0] - self._ticks[0]) * self._tick * self._radii[0]
        travel_right = (ticks[1] - self._ticks[1]) * self._tick * self._radii[1]
        forward, turn = (travel_left + travel_right) / 2.0, (travel_right - travel_left) / self._track
        middle = self.pose.yaw + turn / 2.0
        self.pose = Pose2D(
            self.pose.x + forward * math.cos(middle),
            self.pose.y + forward * math.sin(middle),
            wrap_angle(self.pose.yaw + turn),
        )
        dt = now - self._time
        if dt > 0.0:
            self.twist = Twist2D(forward / dt, 0.0, turn / dt)
        self._ticks, self._time = ticks, now

    def reset(self, left: float, right: float, now: float) -> None:
        """Restart at the origin."""
        self._ticks = (math.floor(left / self._tick), math.floor(right / self._tick))
        self._time, self.pose, self.twist = now, Pose2D(), Twist2D()
