"""Velocity commands as an input of the filter: the acceleration that the base probably makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.ekf.state import ACCELERATION, TURNING, TWIST, Array

_SAME_SIGN = 0.01  # [m/s or rad/s] tolerance of the test for a command that points the other way
_AXES = 6


@dataclass(frozen=True)
class Response:
    """How the base answers a command; all arrays have the shape (6,): vx vy vz vroll vpitch vyaw.

    Attributes:
        mask: the axes that are commanded.
        speed_up, slow_down: largest accelerations [m/s^2, rad/s^2].
        speed_up_gain, slow_down_gain: acceleration for each unit of missing speed [1/s].
    """

    mask: NDArray[np.bool_]
    speed_up: Array
    slow_down: Array
    speed_up_gain: Array
    slow_down_gain: Array


@dataclass
class Control:
    """The last command and what follows from it.

    Args:
        response: of the base.
        timeout: an older command counts as zero [s].
    """

    response: Response
    timeout: float
    command: Array = field(default_factory=lambda: np.zeros(_AXES))
    stamp: float = -math.inf

    def hear(self, command: Array, stamp: float) -> None:
        """Take a command (vx vy vz vroll vpitch vyaw) of a time [s]."""
        self.command, self.stamp = command, stamp

    def apply(self, state: Array, now: float, seconds: float) -> None:
        """Set the state's linear accelerations, and add to its turning speeds what they gain in a time [s]."""
        command = self.command if now - self.stamp < self.timeout else np.zeros(_AXES)
        found = self.accelerations(command, state[TWIST])
        linear, turning = self.response.mask[:3], self.response.mask[3:]
        state[ACCELERATION][linear] = found[:3][linear]
        state[TURNING][turning] += found[3:][turning] * seconds

    def accelerations(self, command: Array, speed: Array) -> Array:
        """Accelerations by a command at a speed, both of shape (6,)."""
        missing = command - speed
        aim = np.where(np.abs(missing) <= np.abs(command) + _SAME_SIGN, command, 0.0)
        slows = np.abs(aim) < np.abs(speed)
        limit = np.where(slows, self.response.slow_down, self.response.speed_up)
        gain = np.where(slows, self.response.slow_down_gain, self.response.speed_up_gain)
        return np.asarray(np.clip(gain * missing, -limit, limit))
