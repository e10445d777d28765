"""Those whom a mission met, for rviz on /patrol/people (latched): a figure, and above it who and where."""

from __future__ import annotations

from collections.abc import Iterable

import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from rosbot_patrol.patrol.people import Person

TOPIC = "patrol/people"
_RED, _DARK = ColorRGBA(0.9, 0.1, 0.1, 0.9), ColorRGBA(0.4, 0.0, 0.0, 1.0)


class PeopleMarkers:
    """Publishes them.

    Args:
        frame: of their places.
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._publisher = rospy.Publisher(TOPIC, MarkerArray, queue_size=2, latch=True)

    def clear(self) -> None:
        """A new mission has met nobody."""
        self._publisher.publish(MarkerArray(markers=[Marker(action=Marker.DELETEALL)]))

    def show(self, people: Iterable[Person], stamp: float, room: str) -> None:
        """Those met so far, as far as their places are known.

        Args:
            people: each with its place.
            stamp: of now [s].
            room: where the mission leads, for people to read.
        """
        markers = [marker for person in people for marker in self._markers(person, stamp, room)]
        self._publisher.publish(MarkerArray(markers=markers))

    def _markers(self, person: Person, stamp: float, room: str) -> list[Marker]:
        if person.x is None or person.y is None:
            return []
        body = self._marker("people", person, Marker.CYLINDER, 0.85, stamp)
        body.scale.x = body.scale.y = max(0.4, min(2.0 * person.error, 2.0))
        body.scale.z = 1.7
        body.color = _RED
        text = self._marker("people names", person, Marker.TEXT_VIEW_FACING, 2.0, stamp)
        text.scale.z, text.color = 0.3, _DARK
        text.text = f"{person.label or 'somebody'} {person.number}, {person.room or room}"
        return [body, text]

    def _marker(self, name: str, person: Person, kind: int, height: float, stamp: float) -> Marker:
        marker = Marker(ns=name, id=person.number, type=kind)
        marker.header.frame_id, marker.header.stamp = self._frame, rospy.Time.from_sec(stamp)
        marker.pose.position = Point(person.x, person.y, height)
        marker.pose.orientation.w = 1.0
        return marker
