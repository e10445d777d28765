"""Motion sensors that have been heard, and which of them are silent: a missing heartbeat is the only sign."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Change(Enum):
    """Kind of a change of a sensor."""

    NEW = "new"
    SILENT = "silent"
    BACK = "back"


@dataclass(frozen=True)
class SensorEvent:
    """One change of one sensor.

    Attributes:
        seconds: duration of its silence [s], 0 for a new sensor.
    """

    change: Change
    sensor_id: int
    peer: str
    seconds: float

    def __str__(self) -> str:
        name = f"motion sensor {self.sensor_id}" + (f" ({self.peer})" if self.peer else "")
        if self.change is Change.NEW:
            return f"{name} is there"
        if self.change is Change.BACK:
            return f"{name} is back after {self.seconds:.0f} s"
        return f"{name} has not been heard of for {self.seconds:.0f} s"


@dataclass(frozen=True)
class SensorStatus:
    """Present state of one sensor.

    Attributes:
        seconds: since its last message [s]; messages: how many came; triggers: how many of them reported motion.
    """

    sensor_id: int
    peer: str
    seconds: float
    silent: bool
    messages: int
    triggers: int


class _Sensor:
    def __init__(self, peer: str, now: float) -> None:
        self.peer = peer
        self.heard = now
        self.silent = False
        self.messages = 0
        self.triggers = 0


class MotionSensors:
    """All sensors ever heard; ids are bytes, so there are at most 256.

    Args:
        timeout: silence after which a sensor is silent [s]; they send a heartbeat every 0.5 s.
    """

    def __init__(self, timeout: float = 10.0) -> None:
        self._timeout = timeout
        self._sensors: dict[int, _Sensor] = {}

    def heard(self, sensor_id: int, peer: str, now: float, *, move: bool = False) -> list[SensorEvent]:
        """Record a heartbeat or a trigger of a sensor."""
        sensor = self._sensors.get(sensor_id)
        events = []
        if sensor is None:
            sensor = self._sensors[sensor_id] = _Sensor(peer, now)
            events.append(SensorEvent(Change.NEW, sensor_id, peer, 0.0))
        elif sensor.silent:
            sensor.silent = False
            events.append(SensorEvent(Change.BACK, sensor_id, peer, now - sensor.heard))
        sensor.peer, sensor.heard = peer, now
        sensor.messages += 1
        sensor.triggers += move
        return events

    def tick(self, now: float) -> list[SensorEvent]:
        """Sensors that have just become silent. If the clock goes back, the wait starts again."""
        events = []
        for sensor_id, sensor in self._sensors.items():
            sensor.heard = min(sensor.heard, now)
            if not sensor.silent and now - sensor.heard > self._timeout:
                sensor.silent = True
                events.append(SensorEvent(Change.SILENT, sensor_id, sensor.peer, now - sensor.heard))
        return events

    def statuses(self, now: float) -> list[SensorStatus]:
        """All sensors, by id."""
        return [
            SensorStatus(sensor_id, s.peer, max(now - s.heard, 0.0), s.silent, s.messages, s.triggers)
            for sensor_id, s in sorted(self._sensors.items())
        ]
