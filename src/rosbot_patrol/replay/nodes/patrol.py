"""The patrol over a bag: its manager, stepped at the node's rate on the bag's clock, and at once by a sensor's trigger.

While it rests on guard, only every tenth step is taken, and the next one after an event that may end the rest. Effects
of silence alone, such as a dead detector, are reported up to 0.4 s later than by the node.

The robot's motion, the sensors' and detector's messages and move_base's results are the bag's. So a replay shows this
patrol's decisions from the same inputs. If it would have driven elsewhere, the goals differ, and later results mean
little. Depth pictures are used if the bag has them. Not replayed: checks for black or frozen pictures, orders by
service and action, rounds, mail, state from before a restart.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable
from typing import Any

from rosbot_patrol.patrol.belief.networks import Network
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.mission.params import ManagerParams, NodeParams
from rosbot_patrol.patrol.records.inputs import Battery, Guarded, Inputs
from rosbot_patrol.patrol.search.room_search import RoomSearch
from rosbot_patrol.patrol.senses.health import NoHealth
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.patrol.senses.records import (
    BoxesRecord,
    CountRecord,
    ImageRecord,
    LensRecord,
    LookRecord,
    Moment,
    TriggerRecord,
)
from rosbot_patrol.patrol.senses.senses import PatrolSenses
from rosbot_patrol.patrol.senses.sensor_rooms import SensorRooms
from rosbot_patrol.replay.bags.records import KINDS, MapRecord, Refused
from rosbot_patrol.replay.nodes import patrol_records as heard
from rosbot_patrol.replay.nodes.patrol_link import BagLink
from rosbot_patrol.replay.nodes.patrol_log import PatrolLog
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import TF_TYPES, Input
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.sensors.sensor_file import SensorList
from rosbot_patrol.tf.tree import Edge, TransformTree

STOPPED = "the emergency stop was pressed (topic /e_stop)"
AT_REST = 10  # one step in this many is taken
CAMERA = "camera"  # the input that only tells that pictures come
DEPTH, DEPTH_LENS = "camera/depth/image_raw", "camera/depth/camera_info"

INPUTS = (
    Input(name="motion_trigger", types=("rosbot_patrol/EspTrigger", "rosbot_patrol_simulation/EspTrigger")),
    Input(name="tf", types=TF_TYPES),
    Input(name="tf_static", types=TF_TYPES, is_needed=False),
    Input(name="scan", types=("sensor_msgs/LaserScan",), is_needed=False),
    Input(name="map", types=("nav_msgs/OccupancyGrid",), is_needed=False),
    Input(name="darknet_ros/bounding_boxes", types=("darknet_ros_msgs/BoundingBoxes",), is_needed=False),
    Input(name="darknet_ros/found_object", types=("darknet_ros_msgs/ObjectCount",), is_needed=False),
    Input(name="camera/rgb/camera_info", types=("sensor_msgs/CameraInfo",), is_needed=False),
    Input(name=DEPTH, types=("sensor_msgs/Image",), is_needed=False),
    Input(name=DEPTH_LENS, types=("sensor_msgs/CameraInfo",), is_needed=False),
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
    """A PatrolManager and its node's code around it.

    Args:
        node: the node's own parameters; params: the manager's; frames: tf frames.
        rooms: rooms of the points file.
        sensors: rooms by the sensors' ids.
        known: objects that look like somebody.
        network: whose boxes the bag holds.
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
        known: tuple[KnownObject, ...] = (),
        network: Network,
        static: Iterable[Edge] = (),
    ) -> None:
        self._node, self._params, self._frames = node, params, frames
        self._rooms, self._known, self._network = rooms, known, network
        self._sensor_rooms = SensorRooms(sensors)
        self._tree = TransformTree()
        for edge in static:
            self._tree.add(edge, is_static=True)
        self._link = BagLink()
        self._log = PatrolLog()
        self._guarded, self._stop = Guarded(), ""
        self._camera_at = -math.inf
        self._next: float | None = None
        self._steps, self._left_out, self._is_awake = 0, 0, True
        self.begin(())

    def begin(self, names: Collection[str]) -> None:
        """Store the list of inputs: nothing waits for a camera or depth that the bag lacks."""
        eyes = self._node.eyes
        self._senses = PatrolSenses(
            self._frames,
            eyes if DEPTH in names else dataclasses.replace(eyes, depth_topic=""),
            self._tree,
            rooms=self._rooms,
            alarm_classes=self._node.alarm_classes,
            health=NoHealth(),
        )
        views = RoomSearch(self._node)
        self._manager = PatrolManager(
            self._rooms,
            self._params,
            needs_camera=CAMERA in names,
            views=views,
            viewpoints=views.fallback_viewpoints,
            known=lambda: self._known,
            network=lambda: self._network,
        )

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a record of the named input, recorded at a time [s]."""
        self._step_until(now)
        if isinstance(content, TriggerRecord):
            self._hear_call(content, now)
        elif name in ("tf", "tf_static"):
            for edge in content:
                self._tree.add(edge, is_static=name == "tf_static")
        elif isinstance(content, LaserScan):
            self._senses.lidar.hear(content, now)
        elif isinstance(content, BoxesRecord | CountRecord):
            self._senses.hear_detector(content, _moment(now))
        elif name == CAMERA:
            self._camera_at = now
        elif name in (DEPTH, DEPTH_LENS):
            self._hear_depth(content)
        elif isinstance(content, heard.AliveRecord):
            self._link.hear_status(now)
        elif not isinstance(content, Refused):
            self._is_awake = True
            self._hear_state(content, now)

    def finish(self) -> Result:
        """The patrol's messages and actions."""
        return self._log.result(steps=self._steps)

    # -- inputs

    def _hear_call(self, record: TriggerRecord, now: float) -> None:
        room = self._sensor_rooms.room_of(record.sensor, now) if record.moves else None
        if room is not None:
            self._senses.hear_call(room)
            self._step(now)  # the node is woken, too

    def _hear_depth(self, content: Any) -> None:
        """Take a depth picture or its lens; neither ends the manager's rest."""
        match content:
            case ImageRecord():
                self._senses.depth.hear(content)
            case LensRecord():
                self._senses.depth.hear_lens(content)

    def _hear_state(self, content: Any, now: float) -> None:
        match content:
            case heard.GoalRecord():
                self._link.hear_goal(content)
            case heard.OutcomeRecord():
                self._link.hear_outcome(content)
            case LensRecord():
                self._senses.camera.hear_lens(content)
            case MapRecord():
                self._senses.house_map.hear(content.grid)
            case Battery():
                self._senses.hear_battery(content, now)
            case heard.ModeRecord():
                self._guarded = _guarded(content, now)
            case LookRecord():
                self._senses.ask(content.request(now))
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
        known = self._senses.take(_moment(now), self._guarded, self._stop, is_busy=is_busy)
        return dataclasses.replace(known, link=self._link.state(now), camera_at=self._camera_at)


def _moment(now: float) -> Moment:
    """The moment of a bag's only clock."""
    return Moment(now=now, steady=now, wall=now)


def _guarded(record: heard.ModeRecord, now: float) -> Guarded:
    """The rooms guarded in a mode that was set at a time [s]."""
    return Guarded(
        mode=record.mode,
        rooms=record.rooms,
        why="" if record.rooms is None else record.why,
        is_quiet=record.is_quiet,
        holds_until=now + record.entry_delay if record.entry_delay > 0.0 else None,
    )
