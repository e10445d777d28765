"""Where the camera was when it took a picture, and where each person in it stands.

A picture waits a quarter of a second at most for the robot's place and for its depth. One from before the first depth
picture proves nothing.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, transform_points, wrap_angles
from rosbot_patrol.patrol.intruder.lidar_motion import off_the_map
from rosbot_patrol.patrol.intruder.measure import View, measure
from rosbot_patrol.patrol.records.inputs import Box, Eye, Frame
from rosbot_patrol.patrol.senses.depth import DepthRing
from rosbot_patrol.patrol.senses.house_map import HouseMap
from rosbot_patrol.patrol.senses.lidar import Lidar
from rosbot_patrol.patrol.senses.params import EyesTopics, InputParams
from rosbot_patrol.patrol.senses.records import LensRecord
from rosbot_patrol.patrol.senses.robot_place import RobotPlace
from rosbot_patrol.scan import scan_points
from rosbot_patrol.tf.frames import Frames

Array = NDArray[np.float64]

HELD = 0.25  # longest time that a picture waits for its place and its depth, steady clock [s]
_BEFORE = 0.2  # distance from a wall, or from what the lidar hits, to what may stand before it [m]


@dataclass(frozen=True)
class _Pending:
    frame: Frame
    stamp: float
    came: float


class Camera:
    """Gives pictures their eyes and boxes their places.

    Args:
        eyes: heights and distances.
        params: names of the robot's frames, and how old their transforms may be.
        transforms: of the robot.
        place: of the robot.
        alarm_classes: boxes of other classes are not measured.
        lidar: what it sees beside the camera.
        depth: likewise.
        house_map: what the map shows.
    """

    def __init__(
        self,
        eyes: EyesTopics,
        params: InputParams,
        transforms: Frames,
        *,
        place: RobotPlace,
        alarm_classes: Iterable[str],
        lidar: Lidar,
        depth: DepthRing,
        house_map: HouseMap,
    ) -> None:
        self._eyes, self._params, self._transforms, self._place = eyes, params, transforms, place
        self._classes = frozenset(alarm_classes)
        self._lidar, self._depth, self._map = lidar, depth, house_map
        self._camera: LensRecord | None = None
        self._waiting: deque[_Pending] = deque(maxlen=50)

    def hear_lens(self, record: LensRecord) -> None:
        """Take the camera's lens; the first counts."""
        self._camera = self._camera or record

    def hear(self, frame: Frame, stamp: float, steady: float) -> None:
        """Take what the detector saw.

        Args:
            frame: without eye and places.
            stamp: time of the picture [s], 0 if unknown.
            steady: time of arrival [s].
        """
        self._waiting.append(_Pending(frame, stamp, steady))

    def take(self, steady: float, *, is_busy: bool) -> tuple[Frame, ...]:
        """Take the frames that are ready at a steady time [s]; without a mission nothing is measured."""
        out: list[Frame] = []
        while self._waiting:
            pending = self._waiting[0]
            ready = self._see(pending, steady) if is_busy else pending.frame
            if ready is None:
                break
            self._waiting.popleft()
            out.append(ready)
        return tuple(out)

    def _see(self, pending: _Pending, steady: float) -> Frame | None:
        """The frame with eye and places, None if it has to wait."""
        frame, stamp, camera = pending.frame, pending.stamp, self._camera
        if camera is None or stamp <= 0.0:
            return frame
        may_wait = steady - pending.came < HELD
        pose = self._pose_of(camera.frame, stamp)
        if pose is None:  # the robot's place at that time may be told in a moment
            return None if may_wait else frame
        view = View(camera.lens, pose)
        eye = _eye(view)
        frame = replace(frame, eye=eye)
        if not any(box.label in self._classes for box in frame.boxes):
            return frame
        self._depth.want(steady)
        depth = self._depth.find(stamp, camera.lens)
        if depth is None and self._depth.may_come(stamp) and may_wait:
            return None
        off = self._off_the_map()
        boxes = tuple(
            self._doubted(measure(box, view, depth, off), eye) if box.label in self._classes else box
            for box in frame.boxes
        )
        return replace(frame, boxes=boxes, counts=depth is not None or not self._depth.is_flowing(stamp))

    def _doubted(self, box: Box, eye: Eye) -> Box:
        """Note where a box may be if it was not measured, though depth would measure it from near.

        Only if the lidar sees nothing there that the map lacks.
        """
        seen = self._lidar.view
        if box.measured is not None or seen is None or self._map.house is None or not self._depth.is_on:
            return box
        scan, pose = seen.scan, seen.map_from_laser
        bearing = eye.pose.yaw + eye.bearing((box.xmin + box.xmax) / 2.0)
        beam = int(np.abs(wrap_angles(scan.angles + (pose.yaw - bearing))).argmin())
        away = float(scan.ranges[beam]) if scan.is_hit[beam] else self._eyes.view_range
        if away <= self._eyes.depth_reach:
            return box
        away -= _BEFORE
        return replace(box, doubt=(pose.x + away * math.cos(bearing), pose.y + away * math.sin(bearing)))

    def _pose_of(self, frame: str, stamp: float) -> Array | None:
        """Pose of the camera in map at a time [s], z from the floor, shape (4, 4); None if it is not known."""
        world, odom = self._params.map_frame, self._params.odom_frame
        try:
            pose = self._transforms.transform(world, frame, stamp).matrix
        except TransformError:
            try:  # the map's part of it comes later than odometry
                self._place.map_from_odom(stamp)  # raises if it is too old
                map_from_odom = self._transforms.transform(world, odom).matrix
                pose = map_from_odom @ self._transforms.transform(odom, frame, stamp).matrix
            except TransformError:
                return None
        pose[2, 3] -= self._eyes.floor_height
        return pose

    def _off_the_map(self) -> Array | None:
        """Points that the lidar hits where the map shows nothing [m], shape (N, 2); None if either is not known."""
        view, house = self._lidar.view, self._map.house
        if view is None or house is None:
            return None
        points = transform_points(view.map_from_laser, scan_points(view.scan))
        return off_the_map(house.floor, points, self._eyes.off_map)


def _eye(view: View) -> Eye:
    pose, lens = view.map_from_optical, view.lens
    return Eye(pose=Pose2D(float(pose[0, 3]), float(pose[1, 3]), view.yaw), width=lens.view_width, columns=lens.width)
