"""What the patrol needs of camera, depth, lidar and map to know what was seen, and where a person stands.

Pictures that wait for depth (`depth_ring`) are held back for a quarter of a second at most; those that came before the
first depth picture prove nothing.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.errors import LaserTilted, MapError, TransformError
from rosbot_patrol.geometry import Pose2D, transform_points, wrap_angles
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.regions import RoomRegions, part_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.lidar_motion import off_the_map
from rosbot_patrol.patrol.intruder.measure import View, measure
from rosbot_patrol.patrol.mission.params import EyesTopics, InputParams
from rosbot_patrol.patrol.mission.robot_place import RobotPlace
from rosbot_patrol.patrol.records.inputs import Box, Eye, Frame, ScanView
from rosbot_patrol.ros.messages import convert
from rosbot_patrol.ros.messages.fast_arrays import GridMsg
from rosbot_patrol.ros.patrol.depth_ring import DepthRing, Lenses
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import Worker, now
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import LaserScan, level_scan, scan_points
from rosbot_patrol.scan_check import ScanCheck

log = logging.getLogger(__name__)

_HELD = 0.25  # so long a picture waits for its depth, wall time [s]
_BEFORE = 0.2  # so far before a wall is what hangs on it, or sits behind what the lidar hits [m]


@dataclass(frozen=True)
class _Pending:
    frame: Frame
    stamp: float
    came: float


class PatrolEyes:
    """Gives frames their eyes and boxes their places; keeps the house's floor and the newest scan's place.

    Args:
        topics: where to listen.
        rooms: of the points file.
        alarm_classes: boxes of others are not measured.
        transforms: the node's tf listener.
        frames: names of the robot's frames, and how old their transforms may be.
        health: where to say how it goes.
    """

    def __init__(
        self,
        topics: EyesTopics,
        rooms: Rooms,
        alarm_classes: Iterable[str],
        transforms: Transforms,
        *,
        frames: InputParams,
        health: Health,
    ) -> None:
        self._topics, self._rooms, self._transforms = topics, rooms, transforms
        self._map_frame, self._odom_frame = frames.map_frame, frames.odom_frame
        self._place = RobotPlace(transforms, frames)
        self.health = health
        self._classes = frozenset(alarm_classes)
        self._lenses = Lenses(topics.camera_info_topic)
        self.depth = DepthRing(topics.depth_topic, topics.depth_info_topic, health)
        self._waiting: deque[_Pending] = deque(maxlen=50)
        self._heard: tuple[LaserScanMsg, LaserScan | None] | None = None
        self._scan: tuple[LaserScan, ScanView] | None = None  # as it was heard, and laid level
        self._check = ScanCheck("the patrol looks as without a lidar")
        self._maps: Latest[OccupancyGrid] = Latest()
        self._has_map = threading.Event()
        self.house: RoomRegions | None = None
        Worker(self._part_maps, name="rooms").start()
        rospy.Subscriber("map", GridMsg, self._on_map, queue_size=1, buff_size=1 << 24)

    # -- frames

    def add(self, frame: Frame, stamp: float) -> None:
        """Take what the detector saw in a picture of a time [s], from a callback."""
        self._waiting.append(_Pending(frame, stamp, time.monotonic()))

    def take(self, *, is_busy: bool) -> list[Frame]:
        """The frames that are ready.

        Args:
            is_busy: a mission runs; without one nothing is measured.
        """
        wall = time.monotonic()
        self.depth.tend(wall, is_over=not is_busy)
        if not is_busy and self._check.problem:  # nobody looks at scans now: what was wrong may be mended
            self._check.problem = ""
            self.health.drop("lidar")
        out: list[Frame] = []
        while self._waiting:
            pending = self._waiting[0]
            ready = self._see(pending, wall) if is_busy else pending.frame
            if ready is None:
                break
            self._waiting.popleft()
            out.append(ready)
        return out

    def _see(self, pending: _Pending, wall: float) -> Frame | None:
        """The frame with eye and places, None where it has to wait for depth."""
        frame, stamp, lens = pending.frame, pending.stamp, self._lenses.lens
        pose = self._camera(stamp) if lens is not None and stamp > 0.0 else None
        if pose is None or lens is None:
            is_known = lens is not None and stamp > 0.0  # where the robot was then may be told in a moment
            return None if is_known and wall - pending.came < _HELD else frame
        view = View(lens, pose)
        place = Pose2D(float(pose[0, 3]), float(pose[1, 3]), view.yaw)
        frame = replace(frame, eye=Eye(pose=place, width=lens.view_width, columns=lens.width))
        if not any(box.label in self._classes for box in frame.boxes):
            return frame
        self.depth.want(wall)
        depth = self.depth.find(stamp, lens)
        if depth is None and self.depth.may_come(stamp) and wall - pending.came < _HELD:
            return None
        off = self._off()
        boxes = tuple(
            self._doubted(measure(box, view, depth, off), frame.eye) if box.label in self._classes else box
            for box in frame.boxes
        )
        return replace(frame, boxes=boxes, counts=depth is not None or not self.depth.is_flowing(stamp))

    def _doubted(self, box: Box, eye: Eye | None) -> Box:
        """A box whose place nothing tells, though depth would from near: nothing stands there that the map lacks."""
        if box.measured is not None or eye is None or self._scan is None or self.house is None or not self.depth.is_on:
            return box
        scan, pose = self._scan[1].scan, self._scan[1].map_from_laser
        bearing = eye.pose.yaw + eye.bearing((box.xmin + box.xmax) / 2.0)
        beam = int(np.abs(wrap_angles(scan.angles + (pose.yaw - bearing))).argmin())
        away = float(scan.ranges[beam]) if scan.is_hit[beam] else self._topics.view_range
        if away <= self._topics.depth_reach:
            return box
        away -= _BEFORE
        return replace(box, doubt=(pose.x + away * math.cos(bearing), pose.y + away * math.sin(bearing)))

    def _camera(self, stamp: float) -> NDArray[np.float64] | None:
        """Pose of the camera in map at a moment, z from the floor, None where it is not known."""
        frame = self._lenses.frame
        try:
            pose = self._transforms.lookup_matrix(self._map_frame, frame, stamp)
        except TransformError:
            try:  # the map's part of it comes later than odometry
                odom_from_camera = self._transforms.lookup_matrix(self._odom_frame, frame, stamp)
                self._place.map_from_odom(stamp)  # raises where it is too old
                pose = self._transforms.lookup_matrix(self._map_frame, self._odom_frame, 0.0) @ odom_from_camera
            except TransformError:
                return None
        pose[2, 3] -= self._topics.floor_height
        return pose

    # -- lidar

    def usable(self, message: LaserScanMsg | None) -> LaserScan | None:
        """A scan as a record, None where it says nothing; it is converted and judged once."""
        if message is None:
            return None
        if self._heard is None or self._heard[0] is not message:
            scan = convert.scan_from_msg(message)
            self._heard = message, scan if self._check.accepts(scan, now()) else None
            if self._check.problem:
                self._tell_lidar()
        return self._heard[1]

    def look(self, scan: LaserScan | None) -> ScanView | None:
        """The newest scan, level and with its place in map; None where either is not known."""
        if scan is None:
            return None
        if self._scan is not None and self._scan[0] is scan:
            return self._scan[1]
        try:
            map_from_laser = self._transforms.transform(self._map_frame, scan.frame_id, scan.stamp)
            level = level_scan(scan, map_from_laser, self._map_frame)
        except LaserTilted as err:
            self.refuse(err)
            return None
        except TransformError:
            return self._scan[1] if self._scan is not None and abs(scan.stamp - self._scan[0].stamp) < 0.5 else None
        self._check.clear(now())
        self._tell_lidar()
        self._scan = scan, ScanView(scan=level.scan, map_from_laser=level.pose)
        return self._scan[1]

    def refuse(self, err: LaserTilted) -> None:
        """Leave out a scan that cannot be laid level, and say so."""
        self._check.refuse(str(err), now())
        self._tell_lidar()

    def _tell_lidar(self) -> None:
        problem = self._check.problem
        self.health.set("lidar", WARN if problem else OK, problem or "scans can be used")

    def _off(self) -> NDArray[np.float64] | None:
        """What the lidar hits where the map shows nothing [m]."""
        if self._scan is None or self.house is None:
            return None
        view = self._scan[1]
        points = transform_points(view.map_from_laser, scan_points(view.scan))
        return off_the_map(self.house.floor, points, self._topics.off_map)

    # -- map

    def _on_map(self, message: OccupancyGrid) -> None:
        self._maps.set(message, now())
        self._has_map.set()

    def _part_maps(self) -> None:
        while not rospy.is_shutdown():
            self._has_map.wait(1.0)
            self._has_map.clear()
            message = self._maps.take()
            if message is not None:
                self._part(message)

    def _part(self, message: OccupancyGrid) -> None:
        try:
            house = part_rooms(floor_of(convert.grid_from_msg(message, rospy.resolve_name("map"))), self._rooms)
        except MapError as err:
            self._refuse(err)
            return
        if self.house is None:
            areas = ", ".join(f"{room.id}: {house.area(room.id):.0f}" for room in self._rooms)
            log.info("floor of the rooms [m2]: %s", areas)
        if self.house is None or self.house.lost != house.lost:
            self._tell_lost(house)
        self.house = house
        self.health.set("map", OK, "the map can be used")

    def _refuse(self, err: MapError) -> None:
        """Say that a map is left out, and what that means."""
        rest = "the rooms of the map before stay" if self.house else "shares of floor seen are not known"
        text = f"rooms cannot be told from the map: {err}; {rest}"
        log.error("%s", text)
        self.health.set("map", WARN if self.house else ERROR, text)

    def _tell_lost(self, house: RoomRegions) -> None:
        """Rooms that the patrol refuses, by name."""
        lost = [f"{room.title}: {house.refusal(room)}" for room in self._rooms if room.id in house.lost]
        for text in lost:
            log.error("%s, %s", text, "until then it is not looked at")
        if self._rooms.base.id in house.lost:
            log.error("the robot stays where its missions end, as its base is not on the map")
        level, text = (ERROR, "; ".join(lost)) if lost else (OK, "all rooms are on the map")
        self.health.set("rooms", level, text)
