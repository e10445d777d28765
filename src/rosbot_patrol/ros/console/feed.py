"""What the console shows, from topics. Camera, map and transforms are subscribed to only while somebody looks."""

from __future__ import annotations

import logging
import threading
import time

import rospy
from darknet_ros_msgs.msg import BoundingBoxes
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import OccupancyGrid, Path
from sensor_msgs.msg import BatteryState, CompressedImage
from std_msgs.msg import Bool, Empty
from visualization_msgs.msg import Marker, MarkerArray

from rosbot_patrol.console.house.files import HouseFiles
from rosbot_patrol.console.live.day_log import DayLog
from rosbot_patrol.console.live.house_state import Box, Call, Problem, RoomMark
from rosbot_patrol.console.live.hub import CAMERA, MAP, Hub
from rosbot_patrol.console.live.map_picture import draw_map, draw_seen
from rosbot_patrol.errors import MapError, ParamError, TransformError
from rosbot_patrol.msg import Alert, EspTrigger, PatrolState, SensorStates
from rosbot_patrol.msg import Arming as ArmingMsg
from rosbot_patrol.ros.console.records import arming_from_msg, battery_from_msg, guard_from_msg, sensor_from_msg
from rosbot_patrol.ros.messages.convert import grid_from_msg
from rosbot_patrol.ros.messages.fast_arrays import GridMsg
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import Worker, now
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

_ALIVE_FOR = 4.0  # [s] after its last sign of life the patrol counts as gone
_PROBLEM_FOR = 15.0  # [s] after which a problem that nobody repeats is over
_TICK = 0.2  # [s]
_MAP_RETRY = 2.0  # [s]
_CALLS = 100  # sensors
_DEVICES = {"scan": "lidar", "odom": "base", "camera/rgb/camera_info": "camera"}
_POINTS = 120  # of a path that is drawn
_SHOWN_FOR = 1.5  # [s] for which boxes are shown
_PLAN_PARAMS = ("move_base/base_global_planner",)
_DEFAULT_PLANNER = "NavfnROS"


class Feed:
    """Subscribes, and keeps the hub up to date.

    Args:
        hub: of the pages.
        house: files of the house.
        day_log: notes what changes; None: nobody does.
    """

    def __init__(self, hub: Hub, house: HouseFiles, day_log: DayLog | None = None) -> None:
        self._hub, self._house, self._day_log = hub, house, day_log
        self._house_marks: object = None
        self._devices: dict[str, float] = {}
        self._lock = threading.Lock()
        self._problems: dict[str, tuple[Problem, float]] = {}
        self._alive = self._boxes_at = float("-inf")
        self._maps: Latest[OccupancyGrid] = Latest()
        self._transforms: Transforms | None = None
        self._viewers: dict[str, int] = {}
        self._optional: dict[str, list[rospy.Subscriber]] = {}
        self.follow_house()
        self._subscribe()
        hub.on_viewers = self._viewers.__setitem__  # the pages' thread does not wait for the master
        Worker(self._run, name="feed").start()

    def follow_house(self) -> None:
        """Read the house's files anew if they have changed; of wrong ones what was read before stays."""
        marks = self._house.marks
        if marks == self._house_marks:
            return
        self._house_marks = marks
        try:
            rooms, zones, known = self._house.rooms or (), self._house.zones, self._house.known
        except ParamError as err:
            log.error("%s; the pages show what was read before", err)
            return
        marked = tuple(RoomMark(id=room.id, name=room.name, x=room.pose.x, y=room.pose.y) for room in rooms)
        self._hub.change(rooms=marked, zones=zones, known=known, house=self._hub.state.house + 1)

    def _subscribe(self) -> None:
        hub = self._hub
        rospy.Subscriber("patrol/state", PatrolState, lambda m: hub.change(guard=guard_from_msg(m)), queue_size=10)
        rospy.Subscriber("patrol/arming", ArmingMsg, lambda m: hub.change(arming=arming_from_msg(m)), queue_size=5)
        rospy.Subscriber("patrol/alive", Empty, self._on_alive, queue_size=2)
        rospy.Subscriber("patrol/alerts", Alert, lambda _: hub.count_incident(), queue_size=10)
        rospy.Subscriber("e_stop", Bool, lambda m: hub.change(is_stopped=bool(m.data)), queue_size=5)
        rospy.Subscriber("battery", BatteryState, lambda m: hub.change(battery=battery_from_msg(m)), queue_size=1)
        rospy.Subscriber("sensors/states", SensorStates, self._on_sensors, queue_size=2)
        rospy.Subscriber("motion_trigger", EspTrigger, self._on_motion, queue_size=100)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics, queue_size=50)
        rospy.Subscriber("map", GridMsg, lambda m: self._maps.set(m, now()), queue_size=1, buff_size=1 << 24)

    def watch_devices(self) -> None:
        """Note which of the robot's devices are heard, as the set-up guide shows."""
        for topic, name in _DEVICES.items():

            def hear(_message: object, name: str = name) -> None:
                self._devices[name] = time.monotonic()

            rospy.Subscriber(topic, rospy.AnyMsg, hear, queue_size=1)

    # -- seldom

    def _on_alive(self, _message: Empty) -> None:
        self._alive = time.monotonic()
        self._hub.change(is_heard=True)

    def _on_motion(self, message: EspTrigger) -> None:
        """Note that a sensor reports motion, at most once a second."""
        before = self._hub.state.calls
        last = next((call.at for call in before if call.sensor == message.id), float("-inf"))
        at = time.monotonic()
        if message.move and at - last >= 1.0:
            others = tuple(call for call in before if call.sensor != message.id)
            self._hub.change(calls=(*others[-_CALLS:], Call(sensor=message.id, at=at)))

    def _on_sensors(self, message: SensorStates) -> None:
        self._hub.change(sensors=tuple(map(sensor_from_msg, message.sensors)))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        at = time.monotonic()
        with self._lock:
            for status in message.status:
                if status.level == DiagnosticStatus.OK:
                    self._problems.pop(status.name, None)
                else:
                    is_error = status.level >= DiagnosticStatus.ERROR
                    self._problems[status.name] = (
                        Problem(name=status.name, text=status.message, is_error=is_error),
                        at,
                    )
        self._show_problems(at)

    def _show_problems(self, at: float) -> None:
        with self._lock:
            self._problems = {name: each for name, each in self._problems.items() if at - each[1] <= _PROBLEM_FOR}
            found = {name: problem for name, (problem, _) in self._problems.items()}
        self._hub.change(problems=found)

    # -- while somebody looks

    def _follow_viewers(self) -> None:
        for subject, watch in ((CAMERA, self._watch_camera), (MAP, self._watch_map)):
            is_on, is_wanted = subject in self._optional, self._viewers.get(subject, 0) > 0
            if is_wanted and not is_on:
                self._optional[subject] = watch()
            elif is_on and not is_wanted:
                for subscriber in self._optional.pop(subject):
                    subscriber.unregister()

    def _watch_camera(self) -> list[rospy.Subscriber]:
        topic, boxes = "rgb_republish/compressed", "/darknet_ros/bounding_boxes"
        return [
            rospy.Subscriber(
                topic, CompressedImage, lambda m: self._hub.show(bytes(m.data)), queue_size=1, buff_size=1 << 22
            ),
            rospy.Subscriber(boxes, BoundingBoxes, self._on_boxes, queue_size=1),
        ]

    def _watch_map(self) -> list[rospy.Subscriber]:
        planner = next((rospy.get_param(name, "") for name in _PLAN_PARAMS), "")
        name = str(planner).rpartition("/")[2] or _DEFAULT_PLANNER
        return [
            rospy.Subscriber(f"move_base/{name}/plan", Path, self._on_path, queue_size=1),
            rospy.Subscriber("patrol/people", MarkerArray, self._on_people, queue_size=2),
            rospy.Subscriber("patrol/seen", OccupancyGrid, self._on_seen, queue_size=1),
        ]

    def _on_boxes(self, message: BoundingBoxes) -> None:
        self._boxes_at = time.monotonic()
        boxes = (
            Box(xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax, label=b.Class, probability=b.probability)
            for b in message.bounding_boxes
        )
        self._hub.move(boxes=tuple(box for box in boxes if box.probability >= 0.3))

    def _on_path(self, message: Path) -> None:
        step = max(len(message.poses) // _POINTS, 1)
        places = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses[::step]]
        self._hub.move(path=tuple((round(x, 2), round(y, 2)) for x, y in places))

    def _on_seen(self, message: OccupancyGrid) -> None:
        if not message.data:
            self._hub.move(seen=None)
            return
        try:
            self._hub.move(seen=draw_seen(grid_from_msg(message, "patrol/seen")))
        except MapError as err:
            log.warning("the seen floor is not shown: %s", err)

    def _on_people(self, message: MarkerArray) -> None:
        spots = [
            m.pose.position for m in message.markers if m.action == Marker.ADD and m.type != Marker.TEXT_VIEW_FACING
        ]
        self._hub.move(people=tuple({(round(p.x, 2), round(p.y, 2)): None for p in spots}))

    # -- regularly

    def _run(self) -> None:
        number, wait = 0, _MAP_RETRY
        while not rospy.is_shutdown():
            time.sleep(_TICK)
            if self._day_log is not None:
                self._day_log.follow(self._hub.state)
            self._follow_viewers()
            at = time.monotonic()
            if at - self._alive > _ALIVE_FOR:
                self._hub.change(is_heard=False)
            if at - self._boxes_at > _SHOWN_FOR:
                self._hub.move(boxes=())
            wait -= _TICK
            if wait <= 0.0:
                wait = _MAP_RETRY
                self._show_problems(at)
                self.follow_house()
                lately = (name for name, heard in self._devices.items() if at - heard < _ALIVE_FOR)
                self._hub.change(devices=frozenset(lately))
            if (message := self._maps.take()) is not None:
                number += 1
                self._draw(message, number)
            if MAP in self._optional:
                self._place()

    def _draw(self, message: OccupancyGrid, number: int) -> None:
        try:
            grid = grid_from_msg(message, rospy.resolve_name("map"))
            self._hub.map, self._hub.grid = draw_map(grid, number), grid
        except MapError as err:
            log.warning("the console shows no map: %s", err)
            return
        self._hub.move(robot=self._hub.scene.robot)

    def _place(self) -> None:
        if self._transforms is None:
            self._transforms = Transforms()
        try:
            pose = self._transforms.lookup("map", "base_link")
        except TransformError:
            self._hub.move(robot=None)
            return
        self._hub.move(robot=(round(pose.x, 2), round(pose.y, 2), round(pose.yaw, 2)))
