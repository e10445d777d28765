"""Map of a mission for its record: the house, the robot's path and stops, and the person."""

from __future__ import annotations

import logging

import rospy

from rosbot_patrol.alerts.pictures.map import MapView, Marks, crop_map, draw_map, view_of_marks
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.errors import MapError
from rosbot_patrol.ros.messages import convert
from rosbot_patrol.ros.messages.fast_arrays import GridMsg

log = logging.getLogger(__name__)


class MissionMap:
    """Store the last map of the topic `map`, and draw missions on it."""

    def __init__(self) -> None:
        self._view: MapView | None = None

    def start(self) -> None:
        """Subscribe to the map."""
        rospy.Subscriber("map", GridMsg, self._on_map, queue_size=1, buff_size=1 << 23)

    def draw(self, incident: Incident) -> list[NewFile]:
        """Draw a mission; on white without a map, nothing without positions of the robot."""
        if not incident.path and incident.pose is None:
            return []
        marks = Marks(path=incident.path, robot=incident.pose, person=incident.person)
        caption = "The robot's way (blue)"
        caption += ", where it stood when somebody was seen (arrow)" if incident.pose else ""
        caption += ", the person (red)" if incident.person else ""
        data = draw_map(self._view or view_of_marks(marks), marks)
        return [NewFile(name="map.png", role="map", data=data, caption=caption)]

    def _on_map(self, message: GridMsg) -> None:
        try:
            self._view = crop_map(convert.grid_from_msg(message, rospy.resolve_name("map")))
        except MapError as err:
            log.error("the map cannot be drawn: %s", err)
