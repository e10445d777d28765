"""What the patrol hears: callbacks store, a step reads. A call of a sensor is on disk before its callback ends."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import rospy
from darknet_ros_msgs.msg import BoundingBoxes, ObjectCount
from sensor_msgs.msg import BatteryState
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.msg import EspTrigger, SensorEvent
from rosbot_patrol.patrol.calls.journal import Journal
from rosbot_patrol.patrol.calls.repeats import Repeats
from rosbot_patrol.patrol.guard.battery import battery_of
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.mission.params import InputParams
from rosbot_patrol.patrol.mission.resume import PatrolStore
from rosbot_patrol.patrol.mission.robot_place import RobotPlace
from rosbot_patrol.patrol.records.inputs import Battery, Box, Frame, Guarded, Inputs
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.ros.patrol.sight import PatrolEyes
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.sensors.sensor_file import SensorList

log = logging.getLogger(__name__)

T = TypeVar("T")


@dataclass(frozen=True)
class _Call:
    room: int
    sender: str  # of a latched topic, else ""
    number: int  # in the journal, 0 where it need not be there


class PatrolInputs:
    """Subscribers and what they heard.

    Args:
        params: frames and time-outs.
        rooms: of the points file.
        sensors: whose id calls to which room.
        store: of the patrol's memory.
        journal: where calls are written down.
        eyes: measure what the detector saw.
        transforms: of the robot.
        wake: has a step made at once.

    Attributes:
        on_boxes: told of each picture in which something was seen, with its stamp.
    """

    def __init__(
        self,
        params: InputParams,
        rooms: Rooms,
        sensors: SensorList,
        store: PatrolStore,
        journal: Journal,
        eyes: PatrolEyes,
        transforms: Transforms,
        wake: Callable[[], None],
    ) -> None:
        self.on_boxes: Callable[[float, Sequence[Box]], None] = lambda stamp, boxes: None
        self.eyes, self.transforms = eyes, transforms
        self.params, self._rooms, self._sensors, self._store, self._wake = params, rooms, sensors, store, wake
        self._journal = journal
        self._lock = threading.Lock()  # of the calls; the step wants it, so nobody holds it over the disk
        self._writing = threading.Lock()  # of the journal
        self._calls: deque[_Call] = deque()
        self._on_disk: frozenset[int] = frozenset()
        self._served: frozenset[int] = frozenset()
        self._guarded = Guarded()
        self._requests: deque[Request] = deque(
            Request(room_id=room, wall=wall, note="kept over a restart") for _, room, wall in journal.left
        )
        self.taken = max((number for number, *_ in journal.left), default=store.taken)
        self._heard: deque[Event] = deque(maxlen=1000)
        self._nearest: tuple[LaserScan, float | None] | None = None
        self._detector: Latest[int] = Latest()
        self._scan: Latest[LaserScanMsg] = Latest()
        self._battery: Latest[Battery] = Latest()
        self._started = time.monotonic()
        self._first_heard: set[str] = set()
        self._refused = Repeats()
        self._has_latched = False
        self._place = RobotPlace(transforms, params)
        self._is_lost: bool | None = None

    def ask(self, request: Request) -> None:
        """Take a request from elsewhere."""
        self._requests.append(request)
        self._wake()

    def start(self) -> None:
        """Begin to listen."""
        rospy.Subscriber("motion_trigger", EspTrigger, self._on_trigger, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber("sensors/events", SensorEvent, self._on_sensor_event, queue_size=100)
        rospy.Subscriber("darknet_ros/bounding_boxes", BoundingBoxes, self._on_boxes, queue_size=10)
        rospy.Subscriber("darknet_ros/found_object", ObjectCount, self._on_count, queue_size=10)
        rospy.Subscriber("scan", LaserScanMsg, self._on_scan, queue_size=1, buff_size=1 << 18)
        rospy.Subscriber(self.params.battery_topic, BatteryState, self._on_battery, queue_size=1)

    # -- callbacks store

    def _on_trigger(self, message: EspTrigger) -> None:
        if not message.move:
            return  # a heartbeat
        header = getattr(message, "_connection_header", None) or {}
        sender = str(header.get("callerid", ""))
        is_latched = header.get("latching") == "1"
        is_first = sender not in self._first_heard
        self._first_heard.add(sender)
        is_early = time.monotonic() - self._started < self.params.latched_window
        room = self.room_of(message.id)
        if room is None:
            return
        self._hear(f"motion sensor {message.id} sees motion", sensor=message.id, room=room)
        if is_latched and is_first and is_early and self._store.is_handled(sender, room):
            log.info("the latched trigger for room %d from %s was taken before the restart", room, sender)
            return
        self._call(room, sender if is_latched else "")

    def room_of(self, sensor_id: int) -> int | None:
        """The room that a sensor calls to; without a file its id, which the manager knows or refuses."""
        if not self._sensors.has_file:
            return sensor_id
        room = self._sensors.room_of(sensor_id)
        if room is None and self._refused.is_news(sensor_id, now()):
            log.error("motion trigger refused: %s", self._sensors.refusal(sensor_id))
        return room

    def _call(self, room: int, sender: str) -> None:
        with self._writing:
            with self._lock:
                is_covered = self._is_covered(room)
            number = 0 if is_covered else self._write_down(room)
            with self._lock:
                self._calls.append(_Call(room, sender, number))
                while len(self._calls) > 1000:
                    self._calls.popleft()
        self._wake()

    def _is_covered(self, room: int) -> bool:
        """Whether a call need not be written down: what is on disk answers it, or nothing is to answer it."""
        is_waiting = any(call.room == room and call.number for call in self._calls)
        is_served = room in self._on_disk and room in self._served
        return is_waiting or is_served or not self._guarded.counts(room) or self._rooms.find(room) is None

    def _write_down(self, room: int) -> int:
        try:
            return self._journal.add(room, time.time())
        except OSError as err:
            if self._refused.is_news(-1, now()):
                log.error("a call of room %d cannot be written down: %s; it is taken all the same", room, err)
            return 0

    def _hear(self, text: str, **data: object) -> None:
        self._heard.append(Event(wall=time.time(), kind="sensor", text=text, data=data))

    def _on_sensor_event(self, message: SensorEvent) -> None:
        if message.text:
            self._hear(message.text, sensor=message.id, room=message.room, what=message.kind)
        if message.kind == SensorEvent.LOOK and message.active and message.room >= 0:
            log.warning("%s: the robot looks at room %d", message.text, message.room)
            self._requests.append(
                Request(room_id=message.room, origin=Origin.SILENT_SENSOR, note=message.text, wall=time.time())
            )

    def _on_boxes(self, message: BoundingBoxes) -> None:
        time_now = now()
        self._detector.set(1, time_now)
        if not message.bounding_boxes:
            return  # the count, which always comes, has said so
        stamp = message.image_header.stamp.to_sec() or message.header.stamp.to_sec() or time_now
        boxes = tuple(
            Box(label=b.Class, probability=b.probability, xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax)
            for b in message.bounding_boxes
        )
        self.eyes.add(Frame(stamp=stamp, boxes=boxes), stamp)
        self.on_boxes(stamp, boxes)

    def _on_count(self, message: ObjectCount) -> None:
        self._detector.set(1, now())
        if message.count == 0:  # other counts come with their boxes
            self.eyes.add(Frame(), message.header.stamp.to_sec())

    def _on_scan(self, message: LaserScanMsg) -> None:
        self._scan.set(message, now())

    def _on_battery(self, message: BatteryState) -> None:
        charging = message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING
        said = battery_of(message.percentage, message.voltage, is_present=bool(message.present), is_charging=charging)
        self._battery.set(dataclasses.replace(said, at=now()), now())

    # -- a step reads

    def take(self, time_now: float, guarded: Guarded, stop: str, *, is_busy: bool) -> Inputs:
        """What is known now, and what was heard since the last step; links and camera are left to the caller.

        Args:
            time_now: ROS time [s].
            guarded: what is armed.
            stop: why the emergency stop holds the robot.
            is_busy: a mission runs, so that the scan is looked at.
        """
        self._guarded = guarded
        scan = self.eyes.usable(self._fresh_scan(time_now)) if is_busy else None
        view = self.eyes.look(scan)
        return Inputs(
            wall=time.time(),
            triggers=self._take_calls(),
            requests=tuple(drain(self._requests)),
            frames=tuple(self.eyes.take(is_busy=is_busy)),
            yaw=self._place.yaw(time_now),
            pose=self._pose(time_now),
            clearance=self._clearance(scan),
            scan=view,
            house=self.eyes.house,
            detector_at=self._detector.stamp,
            battery=self._battery.get(),
            guarded=guarded,
            stop=stop,
        )

    def take_heard(self) -> list[Event]:
        """What sensors said since this was asked last, for the record."""
        return drain(self._heard)

    def _take_calls(self) -> tuple[int, ...]:
        with self._lock:
            calls = drain(self._calls)
            self.taken = max((call.number for call in calls), default=0) or self.taken
        for call in calls:
            if call.sender:
                self._store.note_latched(call.sender, call.room)
                self._has_latched = True
        return tuple(call.room for call in calls)

    def has_latched(self) -> bool:
        """Whether the store has heard of a latched trigger since this was asked last."""
        was, self._has_latched = self._has_latched, False
        return was

    def note_served(self, served: frozenset[int]) -> None:
        """Rooms that wait or are being looked at now."""
        self._served = served

    def note_saved(self, served: frozenset[int], taken: int) -> None:
        """The same of the memory that is on disk now, which knows the journal up to `taken`."""
        self._on_disk = served
        with self._writing:
            self._journal.drop(taken)

    def _pose(self, time_now: float) -> Pose2D | None:
        pose = self._place.pose(time_now)
        if (pose is None) != self._is_lost or self._is_lost is None:
            self._is_lost = pose is None
            level, text = (WARN, self._place.problem) if pose is None else (OK, "the robot's pose is known")
            self.eyes.health.set("pose", level, text)
            (log.warning if pose is None else log.info)("%s", text)
        return pose

    def _fresh_scan(self, time_now: float) -> LaserScanMsg | None:
        return self._scan.get() if self._scan.fresh(time_now, self.params.scan_timeout) else None

    def _clearance(self, scan: LaserScan | None) -> float | None:
        """From the robot's centre to the nearest thing [m]; reckoned once for each scan."""
        if scan is None:
            return None
        if self._nearest is None or self._nearest[0] is not scan:
            base = self.params.base_frame
            try:
                points = level_scan(scan, self.transforms.transform(base, scan.frame_id), base).points
            except LaserTilted as err:
                self.eyes.refuse(err)
                return None
            except TransformError:
                return None
            self._nearest = scan, float(np.hypot(*points.T).min()) if len(points) else None
        return self._nearest[1]


def drain(source: deque[T]) -> list[T]:
    """What a queue holds, which is then gone from it."""
    items = []
    while source:
        items.append(source.popleft())
    return items
