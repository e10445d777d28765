"""Rooms of the motion sensors, by their ids."""

from __future__ import annotations

import logging

from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.sensors.sensor_file import SensorList

log = logging.getLogger(__name__)


class SensorRooms:
    """Finds the room of a sensor's id, and says now and then why there is none.

    Args:
        sensors: of the file; without a file an id is the number of its room.
    """

    def __init__(self, sensors: SensorList) -> None:
        self._sensors = sensors
        self._refused = Repeats()

    def room_of(self, sensor_id: int, now: float) -> int | None:
        """Find the room at a time [s]; None if the sensor is refused. The manager knows or refuses the room itself."""
        if not self._sensors.has_file:
            return sensor_id
        room = self._sensors.room_of(sensor_id)
        if room is None and self._refused.is_news(sensor_id, now):
            log.error("motion trigger refused: %s", self._sensors.refusal(sensor_id))
        return room
