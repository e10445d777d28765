"""What a base's own driver leaves out: limits and a time-out for its commands, and a battery as a share."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import STOP, Twist2D
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class AdapterParams:
    """Commands, frames and battery of a base."""

    max_speed: float = param(0.5, unit="m/s", lo=0.0, doc="maximum speed of a command")
    max_turn: float = param(1.5, unit="rad/s", lo=0.0, doc="maximum turning speed of a command")
    command_timeout: float = param(0.5, unit="s", lo=0.05, doc="silence after which the base gets a command to stop")
    command_rate: float = param(
        0.0, unit="Hz", lo=0.0, hi=100.0, doc="rate at which commands are repeated; 0: only as they come"
    )
    odometry_timeout: float = param(1.0, unit="s", lo=0.1, doc="silence after which the base counts as cut off")
    publish_tf: bool = param(False, doc="publish odom -> base_link, for a base that publishes only /odom")
    base_frame: str = param("", doc="the base's own name of base_link, such as base_footprint; empty: base_link")
    battery: str = param(
        "", choices=("", "state", "volts", "share", "percent"), doc="what the battery's topic says; empty: no battery"
    )
    battery_full: float = param(12.6, unit="V", lo=0.0, doc="with volts: voltage of a full battery")
    battery_flat: float = param(9.9, unit="V", lo=0.0, doc="with volts: voltage of an empty one")


def check_adapter(params: AdapterParams, prefix: str = "") -> None:
    """Raise ParamError if the battery's voltages contradict each other."""
    if params.battery_full <= params.battery_flat:
        problem = f"is {params.battery_full:g}, expected more than battery_flat {params.battery_flat:g}"
        raise ParamError(f"{prefix}battery_full", problem)


class CommandGate:
    """Limits commands and ends them.

    A command with a number that is not finite counts as a stop.
    """

    def __init__(self, params: AdapterParams) -> None:
        self._params = params
        self._command = STOP
        self._at = -math.inf
        self._sent_at = -math.inf
        self._is_stopped = True

    def take(self, twist: Twist2D, now: float) -> Twist2D:
        """The command to send for one that came at a time [s]."""
        p = self._params
        is_sane = all(map(math.isfinite, twist))
        self._command = (
            Twist2D(
                min(max(twist.vx, -p.max_speed), p.max_speed),
                min(max(twist.vy, -p.max_speed), p.max_speed),
                min(max(twist.wz, -p.max_turn), p.max_turn),
            )
            if is_sane
            else STOP
        )
        self._at = self._sent_at = now
        self._is_stopped = False
        return self._command

    def due(self, now: float) -> Twist2D | None:
        """The command to send at a time [s] without a new one: a stop after the time-out, a repetition, or None."""
        p = self._params
        if not self._is_stopped and now - self._at >= p.command_timeout:
            self._is_stopped, self._command, self._sent_at = True, STOP, now
            return STOP
        if p.command_rate and now - self._sent_at >= 1.0 / p.command_rate:
            self._sent_at = now
            return self._command
        return None


def share_of_voltage(volts: float, flat: float, full: float) -> float:
    """Share of the charge by a straight line between two voltages, 0 to 1; NaN if the voltage is not finite."""
    return min(max((volts - flat) / (full - flat), 0.0), 1.0) if math.isfinite(volts) else math.nan
