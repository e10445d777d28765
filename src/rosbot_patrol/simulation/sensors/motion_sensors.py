"""The HC-SR501 passive infrared sensor: a lens with zones, and the chip's hold, lock-out and warm-up.

The sensor detects a warm body that crosses zones, so its bearing must change: it misses somebody who stands still or
comes straight at it. Glass and walls are opaque to it. Times are simulated time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.params import param


@dataclass(frozen=True, kw_only=True)
class MotionSensorParams:
    """One type of sensor; defaults from the module's data sheet, both potentiometers at the left stop."""

    cone_deg: float = param(110.0, unit="deg", lo=1.0, hi=180.0, doc="opening angle of the lens")
    reach: float = param(7.0, unit="m", lo=0.1, doc="maximum range at which a person is noticed")
    zone_deg: float = param(4.0, unit="deg", lo=0.1, doc="change of bearing that counts as motion")
    memory: float = param(1.5, unit="s", lo=0.1, doc="time within which that change must happen")
    warm_up: float = param(60.0, unit="s", lo=0.0, doc="time without output after power-on")
    prewarmed: bool = param(True, doc="power-on was long before the start")
    hold: float = param(2.5, unit="s", lo=0.1, doc="time that the output stays high")
    lock_out: float = param(2.5, unit="s", lo=0.0, doc="blind time after the output has fallen")
    retrigger: bool = param(True, doc="motion during the hold prolongs it")


@dataclass(frozen=True, kw_only=True)
class SensorPlace:
    """A sensor on its wall: id, room, TCP port of its bridge, position and direction in the map frame."""

    id: int = param(lo=0, hi=255, doc="id that the sensor reports")
    room: int = param(lo=0, hi=255, doc="room that it watches")
    port: int = param(11411, lo=0, hi=65535, doc="TCP port of the bridge")
    x: float = param(unit="m", doc="position")
    y: float = param(unit="m", doc="position")
    z: float = param(1.6, unit="m", lo=0.0, doc="height")
    yaw: float = param(unit="rad", doc="viewing direction")


class MotionSensor:
    """The sensor's electronics; call `update` at a steady rate with the bodies that its lens sees."""

    def __init__(self, params: MotionSensorParams, started: float = 0.0) -> None:
        self._params = params
        self._ready_at = started if params.prewarmed else started + params.warm_up
        self._high_until = -math.inf
        self._blind_until = -math.inf
        self._tracks: dict[str, list[tuple[float, float]]] = {}
        self.is_high = False

    def update(self, now: float, bearings: Iterable[tuple[str, float]]) -> bool:
        """Advance to a time.

        Args:
            now: time [s].
            bearings: name and bearing [rad] of each warm body in the cone, in reach and in sight.

        Returns:
            Whether the output is high.
        """
        moves = self._sees_motion(now, dict(bearings))
        if self.is_high:
            if moves and self._params.retrigger:
                self._high_until = now + self._params.hold
            if now >= self._high_until:
                self.is_high = False
                self._blind_until = now + self._params.lock_out
                self._tracks.clear()
        elif moves and now >= self._ready_at and now >= self._blind_until:
            self.is_high = True
            self._high_until = now + self._params.hold
        return self.is_high

    def _sees_motion(self, now: float, bearings: dict[str, float]) -> bool:
        moves = False
        for name in [n for n in self._tracks if n not in bearings]:
            del self._tracks[name]
        for name, bearing in bearings.items():
            track = self._tracks.setdefault(name, [])
            track.append((now, bearing))
            while track[0][0] < now - self._params.memory:
                track.pop(0)
            span = max(abs(wrap_angle(bearing - b)) for _, b in track)
            if span >= math.radians(self._params.zone_deg):
                moves = True
                self._tracks[name] = [(now, bearing)]
        return moves


def bearing_in_cone(params: MotionSensorParams, place: SensorPlace, body: Pose2D, warmth: float = 1.0) -> float | None:
    """Bearing of a body from the sensor [rad], None outside the lens's reach; `warmth` 1 is a person's."""
    dx, dy = body.x - place.x, body.y - place.y
    if math.hypot(dx, dy) > params.reach * warmth:
        return None
    bearing = math.atan2(dy, dx)
    if abs(wrap_angle(bearing - place.yaw)) > math.radians(params.cone_deg) / 2.0:
        return None
    return bearing
