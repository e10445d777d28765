"""Turn on the spot by a measured angle, independent of time.

Differs from the original's makeSpin:
- The turned angle is the sum of wrapped yaw increments of odom -> base_link. So full turns are possible, and a wobble
  in the wrong direction is subtracted.
- It slows down towards the end and ends with a zero twist; it also ends at a time-out, and says why.
- It waits while something is too close to turn, and gives up if that stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rosbot_patrol.geometry import angle_difference
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class SpinParams:
    """Turning on the spot: speeds, time limit, clearance."""

    spin_speed: float = param(0.75, unit="rad/s", lo=0.05, hi=6.0, doc="top turning speed of the look-around")
    spin_min_speed: float = param(0.2, unit="rad/s", lo=0.01, hi=6.0, doc="slowest speed that still turns the robot")
    spin_deceleration: float = param(0.6, unit="rad/s^2", lo=0.01, doc="deceleration towards the end of the turn")
    spin_latency: float = param(0.1, unit="s", lo=0.0, hi=2.0, doc="delay from a command to its effect in the pose")
    spin_settle: float = param(0.4, unit="s", lo=0.0, hi=5.0, doc="time at rest before the final angle is read")
    spin_timeout: float = param(
        0.0, unit="s", lo=0.0, doc="time limit of a turn without pauses; 0: three times the ideal duration plus 5 s"
    )
    spin_clearance: float = param(
        0.22, unit="m", lo=0.0, hi=2.0, doc="minimum distance of obstacles from the robot's centre while it turns"
    )
    spin_wait: float = param(
        10.0, unit="s", lo=0.0, doc="longest wait for an obstacle to leave or for the heading in odom"
    )


@dataclass(frozen=True, kw_only=True)
class SpinStep:
    """Output of one step.

    Attributes:
        speed: turning speed to command [rad/s].
        done: the turn is over, well or not.
        problem: reason for an early end, "" for none.
    """

    speed: float
    done: bool = False
    problem: str = ""


def wrap_turn(radians: float) -> float:
    """Angle to turn, wrapped into [0, 2 pi] as in the original."""
    if not math.isfinite(radians):
        raise ValueError(f"{radians} is no angle to turn")
    if 0.0 <= radians <= math.tau:
        return radians
    wrapped = math.fmod(radians, math.tau)
    if wrapped < 0.0:
        wrapped += math.tau
    # whole turns beyond the first leave one turn, as subtracting 2 pi while above 2 pi does
    return math.tau if wrapped == 0.0 and radians > 0.0 else wrapped


class Spin:
    """One turn, by default clockwise as in the original; call `step` at 20 Hz or more."""

    def __init__(self, radians: float, clockwise: bool = True, *, params: SpinParams | None = None) -> None:
        self.params = params or SpinParams()
        self.target = wrap_turn(radians)
        self._sign = -1.0 if clockwise else 1.0
        self.turned = 0.0
        self._yaw: float | None = None
        self._last: float | None = None
        self._active = 0.0
        self._idle = 0.0
        self._settling: float | None = None
        speed = max(self.params.spin_speed, self.params.spin_min_speed)
        self._limit = self.params.spin_timeout or 3.0 * self.target / speed + 5.0

    def step(self, now: float, yaw: float | None, clearance: float | None = None, *, hold: bool = False) -> SpinStep:
        """Measure the turn, and compute the speed.

        Args:
            now: time [s].
            yaw: heading in odom [rad], None if unknown.
            clearance: distance of the nearest obstacle [m], None if unknown.
            hold: stand still for now, without counting the time.
        """
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        self._measure(yaw)
        if self._settling is not None:
            return SpinStep(speed=0.0, done=now - self._settling >= self.params.spin_settle)
        if hold:
            return SpinStep(speed=0.0)
        obstacle = self._obstacle(yaw, clearance)
        if obstacle:
            self._idle += passed
            if self._idle > self.params.spin_wait:
                return self._fail(obstacle)
            return SpinStep(speed=0.0)
        self._idle = 0.0
        self._active += passed
        if self._active > self._limit:
            return self._fail(f"the robot did not turn far enough in {self._limit:.0f} s")
        return self._turn(now)

    @property
    def turned_deg(self) -> float:
        """Angle turned in the requested direction [deg]."""
        return math.degrees(self.turned)

    def _measure(self, yaw: float | None) -> None:
        if yaw is None:
            return
        if self._yaw is not None:
            self.turned += self._sign * angle_difference(yaw, self._yaw)
        self._yaw = yaw

    def _obstacle(self, yaw: float | None, clearance: float | None) -> str:
        if yaw is None:
            return "the heading in odom is not known"
        if clearance is not None and clearance < self.params.spin_clearance:
            return f"something is {clearance:.2f} m from the robot's centre, too near to turn"
        return ""

    def _turn(self, now: float) -> SpinStep:
        p = self.params
        remaining = self.target - self.turned
        speed = min(p.spin_speed, math.sqrt(max(2.0 * p.spin_deceleration * remaining, 0.0)))
        speed = max(speed, min(p.spin_min_speed, p.spin_speed))
        if remaining <= speed * p.spin_latency:
            self._settling = now
            return SpinStep(speed=0.0)
        return SpinStep(speed=self._sign * speed)

    def _fail(self, why: str) -> SpinStep:
        return SpinStep(
            speed=0.0,
            done=True,
            problem=f"the turn ended after {self.turned_deg:.0f} of {math.degrees(self.target):.0f} degrees: {why}",
        )
