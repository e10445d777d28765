"""Motion of the base: commands become wheel speeds, wheel speeds become a motion of the base, with slip.

A skid-steered base turns by dragging its wheels sideways. Bullet's contact model turns a four-wheeled body badly (the
result depends more on the time step than on the friction). So the base is driven as a planar body: its velocity follows
the wheels with the force limit of the tyres, and contacts with walls stop it while the wheels go on turning. The
effective track is that of a real robot: the distance between the wheels' contact lines, increased by the scrub of
turning if a side has several wheels. Geometry comes from the URDF unless it is given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import STOP, Twist2D
from rosbot_patrol.params import param
from rosbot_patrol.simulation.robot.description import RobotDescription


@dataclass(frozen=True, kw_only=True)
class DriveParams:
    """Geometry, limits and slip of the base. `legacy_wheel_separation` 0.1 gives the turning rate of the 2019 model."""

    left_joints: tuple[str, ...] = param(
        (), doc="joints of the left wheels; empty: the URDF's continuous joints on the left"
    )
    right_joints: tuple[str, ...] = param(
        (), doc="joints of the right wheels; empty: the URDF's continuous joints on the right"
    )
    wheel_radius: float = param(0.0, unit="m", lo=0.0, doc="radius of the wheels; 0: from the URDF")
    effective_track: float = param(
        0.0,
        unit="m",
        lo=0.0,
        doc="wheel distance that determines how the base turns; 0: from the URDF, with skid_stretch",
    )
    skid_stretch: float = param(
        0.04, lo=0.0, hi=2.0, doc="relative widening of the track by skidding, with several wheels on a side"
    )
    legacy_wheel_separation: float = param(
        0.0, unit="m", lo=0.0, doc="wheel distance that the controller assumes; 0: the true one (2019 model: 0.1)"
    )
    max_wheel_speed: float = param(10.0, unit="rad/s", lo=0.1, doc="top speed of a wheel")
    wheel_acceleration: float = param(40.0, unit="rad/s^2", lo=0.1, doc="maximum acceleration of a wheel")
    command_timeout: float = param(
        0.5, unit="s", lo=0.0, doc="time after the last command at which the base stops; 0: never"
    )
    traction: float = param(0.8, lo=0.01, doc="friction coefficient of tyres and floor")
    slip: float = param(
        0.002, lo=0.0, hi=0.5, doc="relative standard deviation of each side's travel from its wheels' rotation"
    )
    scrub: float = param(
        0.004, lo=0.0, hi=0.5, doc="relative standard deviation of the turned angle from the wheels' rotation"
    )
    slip_time: float = param(3.0, unit="s", lo=0.01, doc="correlation time of slip and scrub")

    @property
    def wheel_separation(self) -> float:
        """Wheel separation that the controller assumes [m]."""
        return self.legacy_wheel_separation or self.effective_track

    def fitted(self, robot: RobotDescription) -> DriveParams:
        """Complete missing geometry from a robot's URDF; raises WorldError if the URDF does not give it."""
        radius = self.wheel_radius or robot.wheel_radius
        if radius <= 0.0:
            raise WorldError(robot.source, "no shape tells the radius of the wheels: give drive.wheel_radius")
        stretch = 1.0 + self.skid_stretch if robot.is_skid_steered else 1.0
        return replace(self, wheel_radius=radius, effective_track=self.effective_track or robot.track * stretch)


class Drive:
    """Wheel speeds of both sides, and the resulting twist of the base; `params` must be fitted."""

    def __init__(self, params: DriveParams, rng: np.random.Generator) -> None:
        self._params = params
        self._rng = rng
        self._command = STOP
        self._command_time = -math.inf
        self._slip = np.zeros(3)
        self.stuck: frozenset[str] = frozenset()  # sides with blocked wheels: left, right
        self.left = 0.0
        self.right = 0.0

    def command(self, twist: Twist2D, now: float) -> None:
        """Set a command at a time [s]; values that are not finite stop the base."""
        usable = math.isfinite(twist.vx) and math.isfinite(twist.wz)
        self._command = twist if usable else STOP
        self._command_time = now

    def step(self, now: float, dt: float) -> Twist2D:
        """Let the wheels follow the command for `dt` [s]; returns the twist that drives the base."""
        p = self._params
        if p.command_timeout and now - self._command_time > p.command_timeout:
            self._command = STOP
        half = self._command.wz * p.wheel_separation / 2.0
        wanted_left = (self._command.vx - half) / p.wheel_radius
        wanted_right = (self._command.vx + half) / p.wheel_radius
        fastest = max(abs(wanted_left), abs(wanted_right))
        if fastest > p.max_wheel_speed:  # slow down along the same curve
            wanted_left *= p.max_wheel_speed / fastest
            wanted_right *= p.max_wheel_speed / fastest
        change = p.wheel_acceleration * dt
        self.left += min(max(wanted_left - self.left, -change), change)
        self.right += min(max(wanted_right - self.right, -change), change)
        if self.stuck:
            self.left *= "left" not in self.stuck
            self.right *= "right" not in self.stuck
        return self._driven(dt)

    def stop(self) -> None:
        """Stop at once, and clear the command."""
        self._command, self.left, self.right = STOP, 0.0, 0.0

    @property
    def load(self) -> float:
        """Load of the wheels, 0 to 1."""
        return (abs(self.left) + abs(self.right)) / (2.0 * self._params.max_wheel_speed)

    def _driven(self, dt: float) -> Twist2D:
        p = self._params
        keep = math.exp(-dt / p.slip_time)
        self._slip = keep * self._slip + math.sqrt(1.0 - keep * keep) * self._rng.standard_normal(3)
        left = p.wheel_radius * self.left * (1.0 + p.slip * float(self._slip[0]))
        right = p.wheel_radius * self.right * (1.0 + p.slip * float(self._slip[1]))
        turning = (right - left) / p.effective_track * (1.0 + p.scrub * float(self._slip[2]))
        return Twist2D((left + right) / 2.0, 0.0, turning)
