"""Looks at rooms with a silent sensor: one for each silence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.sensors.problems import Kind
from rosbot_patrol.sensors.settings import LookTimes
from rosbot_patrol.sensors.supervisor import SensorStatus, Supervisor


@dataclass(frozen=True, kw_only=True)
class Look:
    """A request to look at the room of a sensor, with the reason."""

    sensor_id: int
    room: int
    text: str


class Looks:
    """Remembers which silences have been answered.

    Silence behind a bridge that has gone is the bridge's problem: the robot is not sent through the whole house for it.
    A sensor that has been silent since the start causes no look, because nothing has changed.
    """

    def __init__(self, params: LookTimes) -> None:
        self._params = params
        self._answered: dict[int, float] = {}
        self._looked: dict[int, float] = {}

    def update(self, watch: Supervisor, listed: Sequence[SensorStatus], now: float) -> list[Look]:
        """Looks to request now; call it about once a second. `listed`: all sensors, from `watch.statuses`."""
        if not self._params.patrol_silent_sensors:
            return []
        problems = watch.problems()
        silent = {key.sensor_id: p for key, p in problems.items() if key.kind is Kind.SILENT}
        gone = {key.bridge for key in problems if key.kind is Kind.BRIDGE_GONE}
        for sensor_id in [n for n in self._answered if n not in silent]:
            del self._answered[sensor_id]
        wishes = []
        heard = {s.sensor_id: s.heard for s in listed}
        for sensor_id, problem in silent.items():
            room = watch.sensors.room_of(sensor_id)
            if sensor_id in self._answered or room is None or problem.bridge in gone or heard[sensor_id] is None:
                continue
            if watch.age(problem.since) < self._params.look_after:
                continue
            self._answered[sensor_id] = now
            if now - self._looked.get(sensor_id, float("-inf")) < self._params.look_interval:
                continue
            self._looked[sensor_id] = now
            wishes.append(Look(sensor_id=sensor_id, room=room, text=f"{watch.title(problem.key)} {problem.what}"))
        return wishes
