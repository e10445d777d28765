"""Inputs of the patrol: callbacks store messages, and a step passes them to the senses."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence

import rospy
from darknet_ros_msgs.msg import BoundingBoxes, ObjectCount
from sensor_msgs.msg import BatteryState
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.msg import EspTrigger, SensorEvent
from rosbot_patrol.patrol.records.inputs import Battery, Box, Guarded, Inputs
from rosbot_patrol.patrol.records.request import Request
from rosbot_patrol.patrol.senses.params import EyesTopics, InputParams
from rosbot_patrol.patrol.senses.records import BoxesRecord, CountRecord, Moment
from rosbot_patrol.patrol.senses.senses import PatrolSenses
from rosbot_patrol.patrol.senses.sensor_rooms import SensorRooms
from rosbot_patrol.ros.messages.convert import scan_from_msg
from rosbot_patrol.ros.messages.senses import battery_from_msg, boxes_from_msg, count_from_msg, look_from_msg
from rosbot_patrol.ros.patrol.calls import CallDesk
from rosbot_patrol.ros.patrol.sight_topics import DepthTopic, LensTopic, MapTopic
from rosbot_patrol.ros.runtime.latest import Latest, drain
from rosbot_patrol.ros.runtime.node import now, sender_of

log = logging.getLogger(__name__)


class PatrolInputs:
    """Subscribers, and their messages since the last step.

    Args:
        params: topic of the battery.
        eyes: topics of camera, depth and map.
        senses: turn the messages into a step's inputs.
        calls: write the motion sensors' calls to the journal.
        sensor_rooms: rooms of the sensors.
        wake: requests a step at once.

    Attributes:
        on_boxes: called with each picture's stamp and detections, in the callback.
    """

    def __init__(
        self,
        params: InputParams,
        eyes: EyesTopics,
        *,
        senses: PatrolSenses,
        calls: CallDesk,
        sensor_rooms: SensorRooms,
        wake: Callable[[], None],
    ) -> None:
        self.on_boxes: Callable[[float, Sequence[Box]], None] = lambda stamp, boxes: None
        self.on_sensor: Callable[[], None] = lambda: None
        self.calls = calls
        self._calls_link: rospy.Subscriber | None = None
        self._senses, self._sensor_rooms, self._wake = senses, sensor_rooms, wake
        self._battery_topic = params.battery_topic
        self._requests: deque[Request] = deque()
        self._heard: deque[Event] = deque(maxlen=1000)
        self._detected: deque[tuple[BoxesRecord | CountRecord, Moment]] = deque(maxlen=100)
        self._scan: Latest[LaserScanMsg] = Latest()
        self._scans_delivered = 0
        self._battery: Latest[Battery] = Latest()
        self._lens = LensTopic(eyes.camera_info_topic)
        self._depth = DepthTopic(eyes.depth_topic, eyes.depth_info_topic, senses.depth)
        self._map = MapTopic(senses.house_map)

    def ask(self, request: Request) -> None:
        """Accept a request from another part of the node."""
        self._requests.append(request)
        self._wake()

    def start(self) -> None:
        """Start the subscribers."""
        self.listen()
        rospy.Subscriber("sensors/events", SensorEvent, self._on_sensor_event, queue_size=100)
        rospy.Subscriber("darknet_ros/bounding_boxes", BoundingBoxes, self._on_boxes, queue_size=10)
        rospy.Subscriber("darknet_ros/found_object", ObjectCount, self._on_count, queue_size=10)
        rospy.Subscriber("scan", LaserScanMsg, self._on_scan, queue_size=1, buff_size=1 << 18)
        rospy.Subscriber(self._battery_topic, BatteryState, self._on_battery, queue_size=1)

    def listen(self) -> None:
        """Listen to the motion sensors; called again, it asks the master anew who speaks."""
        if self._calls_link is not None:
            self._calls_link.unregister()
        self._calls_link = rospy.Subscriber(
            "motion_trigger", EspTrigger, self._on_trigger, queue_size=100, tcp_nodelay=True
        )

    # -- callbacks keep

    def _on_trigger(self, message: EspTrigger) -> None:
        self.on_sensor()
        if not message.move:
            return  # a heartbeat
        sender, is_latched = sender_of(message), _is_latched(message)
        is_first = self.calls.is_first(sender)
        room = self.room_of(message.id)
        if room is None:
            return
        self._hear(f"motion sensor {message.id} sees motion", sensor=message.id, room=room)
        if is_latched and is_first and self.calls.was_taken_before(sender, room):
            return
        self.calls.call(room, sender if is_latched else "")

    def room_of(self, sensor_id: int) -> int | None:
        """Find the room of a sensor; None if the sensor is refused."""
        return self._sensor_rooms.room_of(sensor_id, now())

    def _hear(self, text: str, **data: object) -> None:
        self._heard.append(Event(wall=time.time(), kind="sensor", text=text, data=data))

    def _on_sensor_event(self, message: SensorEvent) -> None:
        if message.text:
            self._hear(message.text, sensor=message.id, room=message.room, what=message.kind)
        request = look_from_msg(message).request(time.time())
        if request is not None:
            log.warning("%s: the robot looks at room %d", message.text, message.room)
            self._requests.append(request)

    def _on_boxes(self, message: BoundingBoxes) -> None:
        record, came = boxes_from_msg(message), moment()
        self._detected.append((record, came))
        if record.boxes:
            self.on_boxes(record.stamp or came.now, record.boxes)

    def _on_count(self, message: ObjectCount) -> None:
        self._detected.append((count_from_msg(message), moment()))

    def _on_scan(self, message: LaserScanMsg) -> None:
        self._scan.set(message, now())

    def _on_battery(self, message: BatteryState) -> None:
        self._battery.set(battery_from_msg(message), now())

    # -- a step takes

    def take(self, time_now: float, guarded: Guarded, stop: str, *, is_busy: bool) -> Inputs:
        """Take the present state, and the events since the last step; the caller adds links and pictures.

        Args:
            time_now: ROS time [s].
            guarded: the armed rooms.
            stop: reason of the emergency stop, "" if the robot may drive.
            is_busy: a mission runs, so scans and pictures are needed.
        """
        self.calls.guarded = guarded
        self._deliver(is_busy=is_busy)
        taken = self._senses.take(
            moment()._replace(now=time_now),
            guarded,
            stop,
            is_busy=is_busy,
            has_depth_publisher=self._depth.has_publisher,
        )
        self._depth.follow()
        return taken

    def take_heard(self) -> list[Event]:
        """Take the sensors' events since the last call, for the record."""
        return drain(self._heard)

    def _deliver(self, *, is_busy: bool) -> None:
        """Pass the messages since the last step to the senses; scans are converted only if needed."""
        senses = self._senses
        for room in self.calls.take():
            senses.hear_call(room)
        for request in drain(self._requests):
            senses.ask(request)
        if self._lens.record is not None:
            senses.camera.hear_lens(self._lens.record)
        self._depth.deliver()
        for record, came in drain(self._detected):
            senses.hear_detector(record, came)
        battery = self._battery.get()
        if battery is not None:
            senses.hear_battery(battery, self._battery.stamp)
        if is_busy and self._scan.count != self._scans_delivered:
            self._deliver_scan()

    def _deliver_scan(self) -> None:
        self._scans_delivered = self._scan.count
        message = self._scan.get()
        if message is not None:
            self._senses.lidar.hear(scan_from_msg(message), self._scan.stamp)


def moment() -> Moment:
    """The present moment on the node's three clocks."""
    return Moment(now=now(), steady=time.monotonic(), wall=time.time())


def _is_latched(message: EspTrigger) -> bool:
    header = getattr(message, "_connection_header", None) or {}
    return header.get("latching") == "1"
