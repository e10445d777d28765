"""The patrol over a bag: its manager, stepped at the node's rate on the bag's clock, and at once by a sensor's call.

While it rests on guard, only every tenth of those steps is taken, and the next one after what may end the rest: what
comes of silence alone, as a dead detector, is told up to 0.4 s later than the node tells it.

The way is the bag's: where the robot was, what its sensors and the detector said, when move_base was done. So a replay
shows what this patrol decides from the same senses; where it would have driven elsewhere, the goals differ, and what
comes after means little. Not replayed: depth pictures (places are told by lidar and floor), whether pictures are black
or stand still, orders by service and action, rounds, mail, what was kept from before a restart.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from rosbot_patrol.errors import TransformError
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.exclusions import Judge
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.mission.params import InputParams, ManagerParams, NodeParams
from rosbot_patrol.patrol.mission.robot_place import RobotPlace
from rosbot_patrol.patrol.records.inputs import Battery, Frame, Guarded, Inputs
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.search.room_search import Eyes
from rosbot_patrol.replay.bags.records import KINDS, MapRecord, Refused
from rosbot_patrol.replay.nodes import patrol_records as heard
from rosbot_patrol.replay.nodes.patrol_link import BagLink
from rosbot_patrol.replay.nodes.patrol_log import PatrolLog
from rosbot_patrol.replay.nodes.patrol_sight import PatrolSight
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import TF_TYPES, Input
from rosbot_patrol.scan import LaserScan, level_scan, scan_problem
from rosbot_patrol.sensors.sensor_file import SensorList
from rosbot_patrol.tf.tree import Edge, TransformTree

STOPPED = "the emergency stop was pressed (topic /e_stop)"
AT_REST = 10  # steps of which one is taken
CAMERA = "camera"  # the input that only says that pictures come

INPUTS = (
    Input(name="motion_trigger", types=("rosbot_patrol/EspTrigger", "rosbot_patrol_simulation/EspTrigger")),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
    Input(name="scan", types=("sensor_msgs/LaserScan",), is_needed=False),
    Input(name="map", types=("nav_msgs/OccupancyGrid",), is_needed=False),
    Input(name="darknet_ros/bounding_boxes", types=("darknet_ros_msgs/BoundingBoxes",), is_needed=False),
    Input(name="darknet_ros/found_object", types=("darknet_ros_msgs/ObjectCount",), is_needed=False),
    Input(name="camera/rgb/camera_info", types=("sensor_msgs/CameraInfo",), is_needed=False),
    Input(
        name=CAMERA,
        topic="camera/rgb/image_raw",
        types=("sensor_msgs/Image", "sensor_msgs/CompressedImage"),
        is_needed=False,
    ),
    Input(name="move_base/status", types=("actionlib_msgs/GoalStatusArray",), is_needed=False),
    Input(name="move_base/goal", types=("move_base_msgs/MoveBaseActionGoal",), is_needed=False),
    Input(name="move_base/result", types=("move_base_msgs/MoveBaseActionResult",), is_needed=False),
    Input(name="battery", types=("sensor_msgs/BatteryState",), is_needed=False),
    Input(name="patrol/arming", types=("rosbot_patrol/Arming",), is_needed=False),
    Input(name="sensors/events", types=("rosbot_patrol/SensorEvent",), is_needed=False),
    Input(name="e_stop", types=("std_msgs/Bool",), is_needed=False),
)


class PatrolReplay:
    """A PatrolManager and what its node does around it.

    Args:
        node: the node's own parameters; params: the manager's; frames: of tf.
        rooms: of the points file.
        sensors: whose id calls to which room.
        judge: who refuses what cannot be an intruder.
        static: transforms that the bag lacks.
    """

    inputs = INPUTS
    kinds = {**KINDS, **heard.KINDS}

    def __init__(
        self,
        node: NodeParams,
        params: ManagerParams,
        frames: InputParams,
        *,
        rooms: Rooms,
        sensors: SensorList,
        judge: Judge,
        static: Iterable[Edge] = (),
    ) -> None:
        self._node, self._params, self._frames = node, params, frames
        self._rooms, self._sensors, self._judge = rooms, sensors, judge
        self._tree = TransformTree()
        for edge in static:
            self._tree.add(edge, is_static=True)
        self._place = RobotPlace(self._tree, frames)
        self._sight = PatrolSight(node.eyes, frames, rooms, node.alarm_classes, self._tree)
        self._link = BagLink()
        self._log = PatrolLog()
        self._calls: list[int] = []
        self._requests: list[Request] = []
        self._scan: tuple[LaserScan, float] | None = None
        self._nearest: tuple[LaserScan, float | None] | None = None
        self._battery: Battery | None = None
        self._guarded, self._stop = Guarded(), ""
        self._detector_at = self._camera_at = -math.inf
        self._next: float | None = None
        self._steps, self._left_out, self._is_awake = 0, 0, True
        self.begin(())

    def begin(self, names: Collection[str]) -> None:
        """Which inputs will be heard; without pictures nobody waits for a camera."""
        views = Eyes(self._node)
        self._manager = PatrolManager(
            self._rooms,
            self._params,
            needs_camera=CAMERA in names,
            views=views,
            viewpoints=views.instead,
            judge=self._judge,
        )

    def hear(self, name: str, now: float, content: Any) -> None:
        """Take in a record of the input of that name, recorded at a time [s]."""
        self._step_until(now)
        if isinstance(content, heard.TriggerRecord):
            self._hear_call(content, now)
        elif name in ("tf", "tf_static"):
            for edge in content:
                self._tree.add(edge, is_static=name == "tf_static")
        elif isinstance(content, LaserScan):
            self._scan = None if scan_problem(content) else (content, now)
        elif isinstance(content, heard.BoxesRecord):
            self._hear_boxes(content, now)
        elif isinstance(content, heard.CountRecord):
            self._detector_at = now
            if content.objects == 0:  # other counts come with their boxes
                self._sight.hear_frame(Frame(), content.stamp, now)
        elif not isinstance(content, Refused):
            self._hear_state(name, content, now)

    def finish(self) -> Result:
        """What the patrol said and did."""
        return self._log.result(steps=self._steps)

    # -- what it hears

    def _hear_call(self, record: heard.TriggerRecord, now: float) -> None:
        room = self._room_of(record.sensor) if record.moves else None
        if room is not None:
            self._calls.append(room)
            self._step(now)  # the node is waked, too

    def _room_of(self, sensor: int) -> int | None:
        return self._sensors.room_of(sensor) if self._sensors.has_file else sensor

    def _hear_boxes(self, record: heard.BoxesRecord, now: float) -> None:
        self._detector_at = now
        if record.boxes:  # the count, which always comes, says so of none
            stamp = record.stamp or now
            self._sight.hear_frame(Frame(stamp=stamp, boxes=record.boxes), stamp, now)

    def _hear_state(self, name: str, content: Any, now: float) -> None:
        self._is_awake |= not isinstance(content, heard.AliveRecord)
        match content:
            case heard.AliveRecord():
                if name == CAMERA:
                    self._camera_at = now
                else:
                    self._link.hear_status(now)
            case heard.GoalRecord():
                self._link.hear_goal(content)
            case heard.OutcomeRecord():
                self._link.hear_outcome(content)
            case heard.LensRecord():
                self._sight.hear_lens(content)
            case MapRecord():
                self._sight.hear_map(content.grid)
            case Battery():
                self._battery = dataclasses.replace(content, at=now)
            case heard.ModeRecord():
                until = now + content.entry_delay if content.entry_delay > 0.0 else None
                self._guarded = Guarded(
                    mode=content.mode,
                    rooms=content.rooms,
                    why="" if content.rooms is None else content.why,
                    is_quiet=content.is_quiet,
                    holds_until=until,
                )
            case heard.LookRecord() if content.room >= 0:
                origin = Origin.SILENT_SENSOR
                self._requests.append(Request(room_id=content.room, origin=origin, note=content.text, wall=now))
            case heard.StopRecord():
                self._stop = STOPPED if content.is_pressed else ""

    # -- steps

    def _step_until(self, now: float) -> None:
        period = 1.0 / self._node.rate
        due = now if self._next is None else self._next
        while due <= now:
            if self._left_out < AT_REST - 1 and not self._is_awake and self._manager.is_resting:
                self._left_out += 1
            else:
                self._step(due)
            due += period
        self._next = due

    def _step(self, now: float) -> None:
        self._steps, self._left_out, self._is_awake = self._steps + 1, 0, False
        commands = self._manager.step(now, self._inputs(now))
        if commands.goal is not None:
            self._link.send(commands.goal)
        self._log.note(now, commands, self._manager.mission)

    def _inputs(self, now: float) -> Inputs:
        is_busy = self._manager.mission is not None
        scan = self._fresh_scan(now) if is_busy else None
        view = self._sight.look(scan)
        calls, self._calls = tuple(self._calls), []
        requests, self._requests = tuple(self._requests), []
        return Inputs(
            wall=now,
            triggers=calls,
            requests=requests,
            frames=self._sight.take(now, is_busy=is_busy),
            yaw=self._place.yaw(now),
            pose=self._place.pose(now),
            clearance=self._clearance(scan),
            link=self._link.state(now),
            detector_at=self._detector_at,
            camera_at=self._camera_at,
            scan=view,
            house=self._sight.house,
            battery=self._battery,
            guarded=self._guarded,
            stop=self._stop,
        )

    def _fresh_scan(self, now: float) -> LaserScan | None:
        is_fresh = self._scan is not None and now - self._scan[1] <= self._frames.scan_timeout
        return self._scan[0] if self._scan is not None and is_fresh else None

    def _clearance(self, scan: LaserScan | None) -> float | None:
        """From the robot's centre to the nearest thing [m]; reckoned once for each scan."""
        if scan is None:
            return None
        if self._nearest is None or self._nearest[0] is not scan:
            base = self._frames.base_frame
            try:
                points = level_scan(scan, self._tree.transform(base, scan.frame_id), base).points
            except TransformError:
                return None
            self._nearest = scan, float(np.hypot(*points.T).min()) if len(points) else None
        return self._nearest[1]
