"""Rooms and motion sensors as markers for rviz, on `~markers` (latched); the patrol's current room is highlighted.

A sensor is red while it reports motion, black if it is silent, yellow if it has another problem.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from rosbot_patrol.msg import EspTrigger, PatrolState, SensorEvent, SensorStates
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.rooms import Room, Rooms, load_rooms
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

QUIET, BUSY, MOTION = ColorRGBA(0.2, 0.5, 0.9, 0.8), ColorRGBA(1.0, 0.6, 0.0, 1.0), ColorRGBA(1.0, 0.1, 0.1, 1.0)
SILENT, BAD = ColorRGBA(0.05, 0.05, 0.05, 1.0), ColorRGBA(1.0, 0.875, 0.0, 1.0)
MOTION_SHOWN_S = 5.0


@dataclass(frozen=True, kw_only=True)
class MarkersParams:
    """Parameters of the node house_markers."""

    path_to_params: str = param(doc="points file of the rooms, as for the patrol")
    motion_sensors: str = param("", doc="file of the motion sensors; empty: none")


def _marker(name: str, key: int, kind: int, place: Point) -> Marker:
    marker = Marker()
    marker.header.frame_id, marker.ns, marker.id, marker.type = "map", name, key, kind
    marker.pose.position = place
    marker.pose.orientation.w = 1.0
    return marker


def room_markers(room: Room, colour: ColorRGBA) -> list[Marker]:
    """A disc at the room point and the room's name above it."""
    disc = _marker("rooms", room.id, Marker.CYLINDER, Point(room.pose.x, room.pose.y, 0.01))
    disc.scale.x = disc.scale.y = 0.5
    disc.scale.z = 0.02
    text = _marker("room names", room.id, Marker.TEXT_VIEW_FACING, Point(room.pose.x, room.pose.y, 0.5))
    text.scale.z = 0.4
    text.text = f"{room.id}: {room.name}"
    disc.color, text.color = colour, ColorRGBA(0.1, 0.1, 0.1, 1.0)
    return [disc, text]


def sensor_markers(sensor: SensorPlace, colour: ColorRGBA) -> list[Marker]:
    """An arrow from the sensor along its view."""
    arrow = _marker("sensors", sensor.id, Marker.ARROW, Point(sensor.x, sensor.y, 0.3))
    arrow.pose.orientation.z, arrow.pose.orientation.w = math.sin(sensor.yaw / 2), math.cos(sensor.yaw / 2)
    arrow.scale.x, arrow.scale.y, arrow.scale.z = 0.7, 0.12, 0.12
    arrow.color = colour
    return [arrow]


class _Markers:
    def __init__(self, rooms: Rooms, sensors: list[SensorPlace]) -> None:
        self._rooms, self._sensors = rooms, sensors
        self._busy: int | None = None
        self._moved: dict[int, float] = {}
        self._wrong: dict[int, ColorRGBA] = {}
        self._lock = threading.Lock()
        self._publisher = rospy.Publisher("~markers", MarkerArray, queue_size=1, latch=True)
        rospy.Subscriber("patrol/state", PatrolState, self._on_state, queue_size=1)
        rospy.Subscriber("motion_trigger", EspTrigger, self._on_trigger, queue_size=20)
        rospy.Subscriber("sensors/states", SensorStates, self._on_sensors, queue_size=1)

    def _on_state(self, state: PatrolState) -> None:
        with self._lock:
            self._busy = state.room_id if state.mission else None

    def _on_trigger(self, trigger: EspTrigger) -> None:
        if trigger.move:
            with self._lock:
                self._moved[trigger.id] = rospy.get_time()

    def _on_sensors(self, message: SensorStates) -> None:
        wrong = {s.id: SILENT if s.state == SensorEvent.SILENT else BAD for s in message.sensors if s.problems}
        with self._lock:
            self._wrong = wrong

    def publish(self) -> None:
        now = rospy.get_time()
        with self._lock:
            busy, moved, wrong = self._busy, dict(self._moved), self._wrong
        out = MarkerArray()
        for room in self._rooms:
            out.markers += room_markers(room, BUSY if room.id == busy else QUIET)
        for sensor in self._sensors:
            lit = 0.0 <= now - moved.get(sensor.id, -math.inf) < MOTION_SHOWN_S
            out.markers += sensor_markers(sensor, MOTION if lit else wrong.get(sensor.id, QUIET))
        self._publisher.publish(out)


def main() -> None:
    """Publish once a second."""

    def body() -> None:
        given = load_params(MarkersParams)
        markers = _Markers(load_rooms(given.path_to_params), read_sensors(given.motion_sensors))
        rate = rospy.Rate(1.0)
        while not rospy.is_shutdown():
            markers.publish()
            rate.sleep()

    run_node("house_markers", body)
