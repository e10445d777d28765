"""Outputs of the patrol: sign of life, state, and wheel commands during turns.

Persons met on a mission are shown in rviz on /patrol/people (latched): a figure with a label each.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable

import numpy as np
import rospy
from geometry_msgs.msg import Point, Twist
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import ColorRGBA, Empty
from visualization_msgs.msg import Marker, MarkerArray

from rosbot_patrol.geometry import STOP, Twist2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.msg import PatrolState
from rosbot_patrol.patrol.house.floor import Mask
from rosbot_patrol.patrol.records.commands import Report
from rosbot_patrol.patrol.records.findings import Person
from rosbot_patrol.patrol.records.mission import Mission, Phase
from rosbot_patrol.ros.messages import convert
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health

log = logging.getLogger(__name__)

_SEEN_PERIOD = 0.5  # [s] between two messages of what was seen


class Wheels:
    """Publisher of /cmd_vel during the patrol's turns; silent at other times."""

    def __init__(self) -> None:
        self.publisher = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self._turning = False

    def turn(self, speed: float | None) -> None:
        """Turn at a speed [rad/s]; None ends a turn with a stop."""
        if speed is None:
            self.stop()
            return
        self._turning = True
        self.publisher.publish(convert.twist_to_msg(Twist2D(wz=speed)))

    def stop(self) -> None:
        """Stop, if it is turning."""
        if self._turning:
            self.publisher.publish(convert.twist_to_msg(STOP))
        self._turning = False


class Pulse:
    """Publisher of /patrol/alive, about once a second of wall time, as proof that the patrol's step runs."""

    def __init__(self) -> None:
        self._at = -math.inf
        self._publisher = rospy.Publisher("patrol/alive", Empty, queue_size=2)

    def step(self) -> None:
        """Publish if it is due; call in each step."""
        if 0.0 <= time.monotonic() - self._at < 1.0:
            return
        self._at = time.monotonic()
        self._publisher.publish(Empty())


class StatePublisher:
    """Publisher of /patrol/state, with log and /diagnostics.

    Args:
        health: health of the node.
    """

    def __init__(self, health: Health) -> None:
        self._health = health
        self._report: Report | None = None
        self._publisher = rospy.Publisher("patrol/state", PatrolState, queue_size=10, latch=True)

    def publish(self, time_now: float, report: Report, mission: Mission | None) -> None:
        """Publish a state if it is new.

        Args:
            time_now: ROS time [s].
            report: the state.
            mission: the active one.
        """
        if self._report is None or (report.phase, report.why) != (self._report.phase, self._report.why):
            log.info("%s: %s", report.phase.value, report.why)
        self._report = report
        message = PatrolState(
            state=report.phase.value,
            mission=report.mission,
            room_id=report.room_id,
            room_name=report.room_name,
            origin=report.origin,
            why=report.why,
            queue=bytes(report.queue),
            verdict=report.verdict,
            last_verdict=report.last_verdict,
            share_seen=-1.0,
            mode=report.mode,
        )
        if mission is not None:
            message.share_seen = -1.0 if mission.share_seen is None else mission.share_seen
            message.phases, message.seconds = list(mission.times), list(mission.times.values())
        message.header.stamp = convert.time_to_msg(time_now)
        self._publisher.publish(message)
        level = OK if report.phase is not Phase.STARTING else WARN
        self._health.set("", level, f"{report.phase.value}: {report.why}")


class SeenPublisher:
    """Publisher of /patrol/seen: the floor that was seen in this mission, while somebody listens.

    Args:
        frame: frame of the map.
    """

    def __init__(self, frame: str) -> None:
        self._frame, self._at, self._is_empty = frame, -math.inf, True
        self._publisher = rospy.Publisher("patrol/seen", OccupancyGrid, queue_size=1)

    def step(self, time_now: float, find: Callable[[], tuple[GridInfo, Mask] | None]) -> None:
        """Publish if it is due; call in each step.

        Args:
            time_now: ROS time [s].
            find: gives the floor's grid and what was seen of it, None for nothing.
        """
        if 0.0 <= time_now - self._at < _SEEN_PERIOD or not self._publisher.get_num_connections():
            return
        self._at, found = time_now, find()
        if found is None:
            if not self._is_empty:
                self._publisher.publish(OccupancyGrid())
            self._is_empty = True
            return
        self._is_empty = False
        info, seen = found
        grid = Grid(info, np.where(seen, 100, -1).astype(np.int8))
        self._publisher.publish(convert.grid_to_msg(grid, self._frame, time_now))


PEOPLE_TOPIC = "patrol/people"
_RED, _DARK = ColorRGBA(0.9, 0.1, 0.1, 0.9), ColorRGBA(0.4, 0.0, 0.0, 1.0)


class PeopleMarkers:
    """Publisher of markers of the persons met.

    Args:
        frame: frame of their places.
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._publisher = rospy.Publisher(PEOPLE_TOPIC, MarkerArray, queue_size=2, latch=True)

    def clear(self) -> None:
        """Clear the markers for a new mission."""
        self._publisher.publish(MarkerArray(markers=[Marker(action=Marker.DELETEALL)]))

    def show(self, people: Iterable[Person], stamp: float, room: str) -> None:
        """Show the persons with a known place.

        Args:
            people: the persons, each with its place.
            stamp: present time [s].
            room: name of the mission's room, for the labels.
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
