"""An inertial unit: turning rate and acceleration with bias and noise, and the heading that it integrates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Twist2D, wrap_angle
from rosbot_patrol.params import param

GRAVITY = 9.8


@dataclass(frozen=True, kw_only=True)
class ImuParams:
    """Errors of the IMU; all zero as in Gazebo."""

    gyro_noise: float = param(0.002, unit="rad/s", lo=0.0, doc="standard deviation of the turning rates")
    gyro_bias: float = param(0.0002, unit="rad/s", doc="constant error of the turning rate about z")
    gyro_walk: float = param(
        0.0,
        unit="rad/s",
        lo=0.0,
        doc="random walk of that bias: standard deviation after 1 s; it grows with the root of time",
    )
    accel_noise: float = param(0.02, unit="m/s^2", lo=0.0, doc="standard deviation of the accelerations")
    accel_bias: float = param(0.0, unit="m/s^2", doc="constant error of the accelerations along x and y")
    heading_noise: float = param(0.002, unit="rad", lo=0.0, doc="standard deviation of the heading")


@dataclass(frozen=True, kw_only=True)
class ImuReading:
    """Heading [rad], turning rates [rad/s] and accelerations [m/s^2] in the unit's frame, shape (3,) each."""

    yaw: float
    rates: tuple[float, float, float]
    accelerations: tuple[float, float, float]


class Imu:
    """Integrate the motion step by step; `read` adds the noise."""

    def __init__(self, params: ImuParams, walk: np.random.Generator | None = None) -> None:
        self._params = params
        self._walk = walk if params.gyro_walk > 0.0 else None
        self._bias = params.gyro_bias
        self._yaw = 0.0
        self._before = Twist2D()
        self._acceleration = (0.0, 0.0)
        self._rate = 0.0

    def step(self, twist: Twist2D, dt: float) -> None:
        """Update with the base's velocity in its own frame after `dt` [s]."""
        if self._walk is not None:
            self._bias += self._params.gyro_walk * math.sqrt(dt) * float(self._walk.standard_normal())
        self._rate = twist.wz + self._bias
        self._yaw = wrap_angle(self._yaw + self._rate * dt)
        self._acceleration = (
            0.9 * self._acceleration[0] + 0.1 * ((twist.vx - self._before.vx) / dt - twist.wz * twist.vy),
            0.9 * self._acceleration[1] + 0.1 * ((twist.vy - self._before.vy) / dt + twist.wz * twist.vx),
        )
        self._before = twist

    def reset(self, yaw: float) -> None:
        """Restart with a heading."""
        self._yaw, self._before, self._acceleration, self._rate = yaw, Twist2D(), (0.0, 0.0), 0.0

    def read(self, rng: np.random.Generator) -> ImuReading:
        """Read one sample."""
        p = self._params
        g = rng.standard_normal(7) * ([p.gyro_noise] * 3 + [p.accel_noise] * 3 + [p.heading_noise])
        return ImuReading(
            yaw=wrap_angle(self._yaw + float(g[6])),
            rates=(float(g[0]), float(g[1]), self._rate + float(g[2])),
            accelerations=(
                self._acceleration[0] + p.accel_bias + float(g[3]),
                self._acceleration[1] + p.accel_bias + float(g[4]),
                GRAVITY + float(g[5]),
            ),
        )
