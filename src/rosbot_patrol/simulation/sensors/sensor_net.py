"""The motion sensors of a house: the bodies that each lens sees, and the outputs with the active faults."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.sensors.motion_sensors import (
    MotionSensor,
    MotionSensorParams,
    SensorPlace,
    bearing_in_cone,
)

Point = Sequence[float]
Sight = Callable[[Point, Sequence[Point]], float]

_OFF_THE_WALL = 0.1  # start of the line of sight before the wall [m]


class WarmBody(Protocol):
    """A body that a motion sensor may detect."""

    @property
    def name(self) -> str:
        """Unique in the world."""

    @property
    def pose(self) -> Pose2D:
        """Present pose."""

    @property
    def is_warm(self) -> bool:
        """Whether a motion sensor can detect it at all."""

    @property
    def warmth(self) -> float:
        """Range of a sensor for it, relative to the range for a person."""

    @property
    def warm_heights(self) -> Sequence[float]:
        """Heights of the points that represent its warm surface [m]."""


class SensorNet:
    """All motion sensors of a house.

    Args:
        params: parameters of each sensor.
        places: their mounting places.
        level: output of a sensor with its faults, from its id, its own output and the time [s].
    """

    def __init__(
        self, params: MotionSensorParams, places: Sequence[SensorPlace], level: Callable[[int, bool, float], bool]
    ) -> None:
        self.places = tuple(places)
        self._params = params
        self._level = level
        self._sensors = {p.id: MotionSensor(params) for p in places}
        self._reported: dict[int, bool] = {}
        self._restarted: list[int] = []

    def update(self, now: float, bodies: Iterable[WarmBody], sight: Sight) -> None:
        """Update every sensor; `sight` gives the share of points (x, y, z) visible from another [m]."""
        warm = [body for body in bodies if body.is_warm]
        for place in self.places:
            self._sensors[place.id].update(now, self._seen_by(place, warm, sight))

    def levels(self, now: float) -> dict[int, bool]:
        """Whether each sensor's output is high, by id."""
        return {n: self._level(n, s.is_high, now) for n, s in self._sensors.items()}

    def changes(self, now: float) -> list[tuple[int, bool]]:
        """Id and level of each sensor with a changed output since the last call."""
        changed = [(n, is_high) for n, is_high in self.levels(now).items() if is_high != self._reported.get(n, False)]
        self._reported.update(changed)
        return changed

    def restart(self, sensor: int, now: float) -> None:
        """Restart a sensor: it warms up anew."""
        self._sensors[sensor] = MotionSensor(replace(self._params, prewarmed=False), now)
        self._reported.pop(sensor, None)
        self._restarted.append(sensor)

    def restarted(self) -> list[int]:
        """Ids of the sensors restarted since the last call."""
        restarted, self._restarted = self._restarted, []
        return restarted

    def _seen_by(self, place: SensorPlace, warm: Iterable[WarmBody], sight: Sight) -> list[tuple[str, float]]:
        seen = []
        for body in warm:
            x, y, _ = body.pose
            bearing = bearing_in_cone(self._params, place, body.pose, body.warmth)
            if bearing is None:
                continue
            eye = (place.x + _OFF_THE_WALL * math.cos(bearing), place.y + _OFF_THE_WALL * math.sin(bearing), place.z)
            share = sight(eye, [(x, y, height) for height in body.warm_heights])
            # The radiation at the lens is proportional to the visible surface over the square of the distance.
            part = body.warmth * math.sqrt(share)
            if share > 0.0 and bearing_in_cone(self._params, place, body.pose, part) is not None:
                seen.append((body.name, bearing))
        return seen
