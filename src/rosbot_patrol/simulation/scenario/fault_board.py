"""The active faults and their effects on readings; used by the simulation's thread only."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.params import unknown_name
from rosbot_patrol.simulation.population import Population
from rosbot_patrol.simulation.scenario.faults import (
    ALL_SENSORS,
    BaseSilent,
    CameraBlack,
    CameraFrozen,
    CameraSilent,
    Doorway,
    DoorwayBlocked,
    Fault,
    LidarSilent,
    LinkPoor,
    MotionFlapping,
    MotionRebooting,
    MotionSilent,
    MotionStuck,
    OdometrySlip,
    RobotCarried,
    SensorFault,
    WheelStuck,
)
from rosbot_patrol.simulation.sensors.camera import Picture
from rosbot_patrol.simulation.sensors.sensor_net import SensorNet

log = logging.getLogger(__name__)

F = TypeVar("F", bound=Fault)

_SILENT = {"base": BaseSilent, "camera": CameraSilent, "lidar": LidarSilent}
_CLOSE = 1e-9  # tolerance for equal times [s]


class Site(Protocol):
    """The engine's parts that a fault may change, besides readings."""

    @property
    def population(self) -> Population:
        """The world's actors, doors and boxes."""

    @property
    def motion_sensors(self) -> SensorNet:
        """The motion sensors."""

    def carry(self, pose: Pose2D) -> None:
        """Move the robot elsewhere; raises WorldError."""


@dataclass
class _InForce:
    fault: Fault
    began: float
    until: float
    again: float = math.inf
    picture: Picture | None = None


class FaultBoard:
    """Start and end of faults, and their effects.

    Args:
        site: engine that has the faults.
        doorways: places that a fault may name.
    """

    def __init__(self, site: Site, doorways: Mapping[str, Doorway] | None = None) -> None:
        self.doorways = dict(doorways or {})
        self._site = site
        self._in_force: dict[str, _InForce] = {}
        self._next = math.inf
        self.changes = 0  # number of starts and ends

    @property
    def active(self) -> tuple[tuple[Fault, float], ...]:
        """Active faults, each with its start time [s]."""
        return tuple((entry.fault, entry.began) for entry in self._in_force.values())

    def begin(self, fault: Fault, now: float) -> None:
        """Start a fault; one of the same kind and target ends.

        Raises:
            WorldError: its target does not exist, or there is no room for it.
        """
        fault = self._located(fault)
        if isinstance(fault, (SensorFault, LinkPoor)):
            self._check_sensor(fault)
        if fault.name in self._in_force:
            self._end(fault.name, now)
        self._change(fault, now)
        self.changes += 1
        if fault.is_instant or (isinstance(fault, MotionRebooting) and not fault.every):
            log.info("fault at %.2f s: %s", now, fault)
            return
        entry = _InForce(fault, now, now + fault.duration if fault.duration else math.inf)
        if isinstance(fault, MotionRebooting):
            entry.again = now + fault.every
        self._in_force[fault.name] = entry
        self._plan()
        lasts = f", for {fault.duration:g} s" if fault.duration else ""
        log.info("fault begins at %.2f s: %s%s", now, fault, lasts)

    def clear(self, now: float, kind: str = "", target: str = "") -> list[Fault]:
        """End the faults of a kind and target ("": any); returns them."""
        chosen = [
            e.fault for e in self._in_force.values() if kind in ("", e.fault.kind) and target in ("", e.fault.where)
        ]
        for fault in chosen:
            self._end(fault.name, now)
        return chosen

    def advance(self, now: float) -> None:
        """End the faults that are over; call before each step."""
        if now < self._next - _CLOSE:
            return
        for name, entry in list(self._in_force.items()):
            if now >= entry.until - _CLOSE:
                self._end(name, now)
            elif now >= entry.again - _CLOSE and isinstance(entry.fault, MotionRebooting):
                entry.again += entry.fault.every
                self._site.motion_sensors.restart(entry.fault.target, now)
        self._plan()

    # Effects ---------------------------------------------------------------------------------------------------------

    def is_silent(self, what: str) -> bool:
        """Whether "base", "camera" or "lidar" is silent."""
        return bool(self._in_force) and any(self._of(_SILENT[what]))

    def driven(self, twist: Twist2D) -> Twist2D:
        """Velocity of the base for the velocity that the wheels request."""
        for entry in self._in_force.values():
            if isinstance(entry.fault, OdometrySlip):
                factor = entry.fault.factor
                twist = Twist2D(twist.vx * factor, twist.vy * factor, twist.wz * factor)
        return twist

    @property
    def stuck_wheels(self) -> frozenset[str]:
        """Sides with blocked wheels: left, right."""
        return frozenset(entry.fault.where for entry in self._of(WheelStuck))

    def level(self, sensor: int, is_high: bool, now: float) -> bool:
        """Output of a motion sensor for the state `is_high` of its electronics."""
        for entry in self._in_force.values():
            fault = entry.fault
            if isinstance(fault, MotionStuck) and fault.target == sensor:
                return True
            if isinstance(fault, MotionFlapping) and fault.target == sensor:
                return fault.is_high(now - entry.began + _CLOSE)
        return is_high

    def link(self, sensor: int) -> LinkPoor | None:
        """Fault of a sensor's link, None for none; a silent one loses every frame."""
        poor = None
        for entry in self._in_force.values():
            fault = entry.fault
            if isinstance(fault, MotionSilent) and fault.target == sensor:
                return LinkPoor(target=sensor, loss=1.0)
            if isinstance(fault, LinkPoor) and fault.target in (sensor, ALL_SENSORS):
                poor = fault
        return poor

    def seen(self, take: Callable[[], Picture]) -> Picture:
        """The camera's picture with the faults; `take` takes the true one."""
        for entry in self._of(CameraBlack):
            if entry.picture is None:
                real = take()
                entry.picture = Picture(np.zeros_like(real.colour), np.full_like(real.depth, np.nan))
            return entry.picture
        for entry in self._of(CameraFrozen):
            if entry.picture is None:
                entry.picture = take()
            return entry.picture
        return take()

    # -----------------------------------------------------------------------------------------------------------------

    def _of(self, kind: type[F]) -> list[_InForce]:
        return [e for e in self._in_force.values() if isinstance(e.fault, kind)]

    def _plan(self) -> None:
        self._next = min((min(e.until, e.again) for e in self._in_force.values()), default=math.inf)

    def _end(self, name: str, now: float) -> None:
        fault = self._in_force.pop(name).fault
        if isinstance(fault, DoorwayBlocked):
            self._site.population.remove_box(fault.name)
        self.changes += 1
        self._plan()
        log.info("fault ends at %.2f s: %s", now, fault)

    def _change(self, fault: Fault, now: float) -> None:
        if isinstance(fault, RobotCarried):
            self._site.carry(fault.pose)
        elif isinstance(fault, MotionRebooting):
            self._site.motion_sensors.restart(fault.target, now)
        elif isinstance(fault, DoorwayBlocked) and fault.x is not None and fault.y is not None:
            size = (fault.width or 0.9, fault.depth, fault.height)
            self._site.population.place_box(fault.name, Pose2D(fault.x, fault.y, fault.yaw or 0.0), size)

    def _located(self, fault: Fault) -> Fault:
        if not isinstance(fault, DoorwayBlocked) or not fault.target or fault.x is not None:
            return fault
        door = self.doorways.get(fault.target)
        if door is None:
            problem = unknown_name(fault.target, self.doorways) if self.doorways else "no doorway has a name here"
            raise WorldError(f"fault '{fault.name}'", problem)
        yaw = door.yaw if fault.yaw is None else fault.yaw
        return replace(fault, x=door.x, y=door.y, yaw=yaw, width=fault.width or door.width)

    def _check_sensor(self, fault: SensorFault | LinkPoor) -> None:
        ids = [place.id for place in self._site.motion_sensors.places]
        if fault.target not in ids and fault.target != ALL_SENSORS:
            there = ", ".join(map(str, ids)) or "none"
            raise WorldError(f"fault '{fault.name}'", f"there is no motion sensor {fault.target} (there: {there})")
