"""The motion sensors of a house: what each one's lens can see, and its output with the faults in force."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from rosbot_patrol.simulation.actors.walkers import Walker
from rosbot_patrol.simulation.scenario.fault_board import FaultBoard
from rosbot_patrol.simulation.sensors.motion_sensors import (
    MotionSensor,
    MotionSensorParams,
    SensorPlace,
    bearing_in_cone,
)

Point = Sequence[float]
Sight = Callable[[Point, Sequence[Point]], float]

_OFF_THE_WALL = 0.1  # [m]


class SensorNet:
    """All of them.

    Args:
        params: of each.
        places: where they hang.
        faults: what is broken.
    """

    def __init__(self, params: MotionSensorParams, places: Sequence[SensorPlace], faults: FaultBoard) -> None:
        self._params = params
        self._places = tuple(places)
        self._faults = faults
        self._sensors = {p.id: MotionSensor(params) for p in places}
        self._told: dict[int, bool] = {}
        self._restarted: list[int] = []

    def update(self, now: float, walkers: Iterable[Walker], sight: Sight) -> None:
        """Let each of them look; `sight` tells what share of some points (x, y, z) is seen from another [m]."""
        warm = [w for w in walkers if w.is_warm]
        for place in self._places:
            self._sensors[place.id].update(now, self._seen_by(place, warm, sight))

    def levels(self, now: float) -> dict[int, bool]:
        """Whether each one's output is high, by id."""
        return {n: self._faults.level(n, s.is_high, now) for n, s in self._sensors.items()}

    def changes(self, now: float) -> list[tuple[int, bool]]:
        """Id and level of each one whose output has changed since this was last asked."""
        changed = [(n, is_high) for n, is_high in self.levels(now).items() if is_high != self._told.get(n, False)]
        self._told.update(changed)
        return changed

    def restart(self, sensor: int, now: float) -> None:
        """Switch one off and on: it warms up anew."""
        self._sensors[sensor] = MotionSensor(replace(self._params, prewarmed=False), now)
        self._told.pop(sensor, None)
        self._restarted.append(sensor)

    def restarted(self) -> list[int]:
        """Ids of those that were switched off and on since this was last asked."""
        restarted, self._restarted = self._restarted, []
        return restarted

    def _seen_by(self, place: SensorPlace, warm: Iterable[Walker], sight: Sight) -> list[tuple[str, float]]:
        seen = []
        for walker in warm:
            x, y, _ = walker.pose
            bearing = bearing_in_cone(self._params, place, walker.pose, walker.warmth)
            if bearing is None:
                continue
            eye = (place.x + _OFF_THE_WALL * math.cos(bearing), place.y + _OFF_THE_WALL * math.sin(bearing), place.z)
            share = sight(eye, [(x, y, height) for height in walker.warm_heights])
            # What reaches the lens goes with the surface in sight over the square of the distance.
            part = walker.warmth * math.sqrt(share)
            if share > 0.0 and bearing_in_cone(self._params, place, walker.pose, part) is not None:
                seen.append((walker.name, bearing))
        return seen
