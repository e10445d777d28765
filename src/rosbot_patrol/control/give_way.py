"""Giving way: the robot waits for a moving person and goes on after they have passed.

Both are extrapolated, the robot along the arc of its command and the person straight on; the least distance between
them decides. A person can walk round or into a robot that stands, but the robot never drives into anybody.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.control.movers import Mover
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, driven, transform_points
from rosbot_patrol.params import param

_STEPS = 21
_SUDDEN = 0.6  # [s]


@dataclass(frozen=True, kw_only=True)
class GiveWayParams:
    """Parameters of giving way."""

    clearance: float = param(
        0.75, lo=0.0, unit="m", doc="minimum distance from base_link to the middle of a passing person"
    )
    near: float = param(1.4, lo=0.0, unit="m", doc="the robot waits for anyone nearer than this who comes nearer")
    beside: float = param(
        0.6, lo=0.0, unit="m", doc="the robot waits for anyone nearer than this until they clearly leave"
    )
    horizon: float = param(2.2, lo=0.0, unit="s", doc="prediction time; 0: give way to nobody")
    turn_horizon: float = param(1.2, lo=0.0, unit="s", doc="prediction time for turning on the spot")
    least_speed: float = param(
        0.15, lo=0.0, unit="m/s", doc="minimum speed of a moving object; slower ones are ordinary obstacles"
    )
    least_age: float = param(
        0.25, lo=0.0, unit="s", doc="minimum tracking time of a moving object, unless it is within `near`"
    )
    hold: float = param(0.5, lo=0.0, unit="s", doc="minimum duration of a stop")
    hold_near: float = param(
        1.5,
        lo=0.0,
        unit="s",
        doc="minimum duration of a stop for somebody within `near`, who may set off again at once",
    )


class GiveWay:
    """Decides whether to wait, and holds the decision for a moment. Times [s] are of one clock."""

    def __init__(self, params: GiveWayParams | None = None) -> None:
        self._params = params or GiveWayParams()
        self._until = -math.inf

    def waits(self, wish: Twist2D, movers: Sequence[Mover], odom_from_base: Pose2D, now: float) -> str:
        """Reason to wait instead of driving a command, in a few words; "" if the way is free."""
        p = self._params
        if wish == STOP or p.horizon == 0.0:
            return ""
        for mover in movers:
            away = math.hypot(mover.x - odom_from_base.x, mover.y - odom_from_base.y)
            if mover.speed < p.least_speed or (mover.age < p.least_age and away > p.near):
                continue
            is_sudden = (
                away < p.near and mover.age < _SUDDEN
            )  # the direction of legs that begin to walk is not known yet
            if is_sudden or self._meets(wish, mover, odom_from_base, away):
                self._until = now + (p.hold_near if away < p.near else p.hold)
                return f"someone comes this way, {away:.1f} m off"
        if now < self._until <= now + max(p.hold, p.hold_near):
            return "someone has just passed"
        return ""

    def _meets(self, wish: Twist2D, mover: Mover, pose: Pose2D, away: float) -> bool:
        p = self._params
        dx, dy = mover.x - pose.x, mover.y - pose.y
        leaving = (mover.vx * dx + mover.vy * dy) / max(away, 1e-6)  # [m/s], negative: the person comes nearer
        if away < p.near and leaving < -0.5 * p.least_speed:
            return True
        if away < p.beside and leaving < 0.5 * mover.speed:
            return True
        is_turn = math.hypot(wish.vx, wish.vy) < 0.01
        times = np.linspace(0.0, p.turn_horizon if is_turn else p.horizon, _STEPS)
        ahead, left, _ = driven(wish, times)
        robot = transform_points(pose, np.column_stack((ahead, left)))
        gaps = np.hypot(mover.x + mover.vx * times - robot[:, 0], mover.y + mover.vy * times - robot[:, 1])
        return bool(gaps.min() < min(p.clearance, gaps[0] - 0.02))
