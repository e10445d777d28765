"""Odometry of two driven wheels from the ticks of their encoders. The counters may wrap.

The robot moves on an arc between two readings (Siegwart and Nourbakhsh, Introduction to Autonomous Mobile Robots,
5.2.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, Twist2D, wrap_angle
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class WheelParams:
    """Wheels and encoders."""

    wheel_radius: float = param(0.035, unit="m", lo=0.001, doc="radius of the driven wheels")
    track: float = param(0.23, unit="m", lo=0.01, doc="distance between the wheels' points on the floor")
    ticks_per_turn: float = param(1440.0, lo=1.0, doc="ticks of an encoder for one turn of its wheel")
    counter_bits: int = param(32, choices=(8, 16, 32), doc="width of the counters, which wrap")
    fastest: float = param(3.0, unit="m/s", lo=0.1, doc="maximum speed of a wheel; more is a restart of the counter")


class TicksOdometry:
    """Pose and speed from two counters.

    Attributes:
        pose: since the first reading; twist: between the last two.
        restarts: readings that were no motion, such as after a reset of the base.
    """

    def __init__(self, params: WheelParams) -> None:
        self._params = params
        self._last: tuple[int, int, float] | None = None
        self.pose, self.twist = Pose2D(), Twist2D()
        self.restarts = 0

    def update(self, left: int, right: int, at: float) -> bool:
        """Take both counters at a time [s]; returns whether they are a motion."""
        last, self._last = self._last, (left, right, at)
        if last is None or at <= last[2]:
            self._last = last or self._last
            return False
        seconds = at - last[2]
        ways = [self._way(now - before) for now, before in ((left, last[0]), (right, last[1]))]
        if max(map(abs, ways)) > self._params.fastest * seconds + self._tick:
            self.restarts += 1
            self.twist = Twist2D()
            return False
        way, turn = (ways[0] + ways[1]) / 2.0, (ways[1] - ways[0]) / self._params.track
        x, y, yaw = self.pose
        chord = way * (math.sin(turn / 2.0) / (turn / 2.0) if abs(turn) > 1e-6 else 1.0)
        middle = yaw + turn / 2.0
        self.pose = Pose2D(x + chord * math.cos(middle), y + chord * math.sin(middle), wrap_angle(yaw + turn))
        self.twist = Twist2D(way / seconds, 0.0, turn / seconds)
        return True

    @property
    def _tick(self) -> float:
        """Way of a wheel for one tick [m]."""
        return math.tau * self._params.wheel_radius / self._params.ticks_per_turn

    def _way(self, ticks: int) -> float:
        half = 1 << (self._params.counter_bits - 1)
        return ((ticks + half) % (2 * half) - half) * self._tick
