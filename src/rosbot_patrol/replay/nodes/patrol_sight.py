"""What the patrol's eyes know of a bag: where the camera was, what stands off the map, where a box's person is.

As `ros/patrol_eyes` does it, but without depth pictures: places are told by the lidar and by the floor.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import LaserTilted, MapError, TransformError
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.grid import Grid
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.regions import RoomRegions, part_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.lidar_motion import off_the_map
from rosbot_patrol.patrol.intruder.measure import Lens, View, measure
from rosbot_patrol.patrol.mission.params import EyesTopics, InputParams
from rosbot_patrol.patrol.mission.robot_place import RobotPlace
from rosbot_patrol.patrol.records.inputs import Eye, Frame, ScanView
from rosbot_patrol.replay.nodes.patrol_records import LensRecord
from rosbot_patrol.scan import LaserScan, level_scan, scan_points
from rosbot_patrol.tf.tree import TransformTree

Array = NDArray[np.float64]

HELD = 0.25  # so long a picture waits for the robot's place [s]


@dataclass(frozen=True)
class _Pending:
    frame: Frame
    stamp: float
    came: float


class PatrolSight:
    """Gives frames their eyes and boxes their places.

    Args:
        topics: of the node, for its heights and distances.
        frames: of map and odometry.
        rooms: of the points file.
        alarm_classes: boxes of others are not measured.
        tree: tf.
    """

    def __init__(
        self,
        topics: EyesTopics,
        frames: InputParams,
        rooms: Rooms,
        alarm_classes: Iterable[str],
        tree: TransformTree,
    ) -> None:
        self._topics, self._frames, self._rooms, self._tree = topics, frames, rooms, tree
        self._place = RobotPlace(tree, frames)
        self._classes = frozenset(alarm_classes)
        self._camera: LensRecord | None = None
        self._waiting: deque[_Pending] = deque(maxlen=50)
        self._scan: tuple[LaserScan, ScanView] | None = None  # as it was heard, and laid level
        self.house: RoomRegions | None = None

    def hear_lens(self, record: LensRecord) -> None:
        """Take the camera's lens; the first counts."""
        self._camera = self._camera or record

    def hear_map(self, grid: Grid) -> None:
        """Part a map among the rooms; one that cannot be is left out."""
        try:
            self.house = part_rooms(floor_of(grid), self._rooms)
        except MapError:
            return

    def hear_frame(self, frame: Frame, stamp: float, now: float) -> None:
        """Take what the detector saw in a picture of a time [s]."""
        self._waiting.append(_Pending(frame, stamp, now))

    def look(self, scan: LaserScan | None) -> ScanView | None:
        """The newest scan with its place in map, None where either is not known."""
        if scan is None:
            return None
        if self._scan is not None and self._scan[0] is scan:
            return self._scan[1]
        world = self._frames.map_frame
        try:
            level = level_scan(scan, self._tree.transform(world, scan.frame_id, scan.stamp), world)
        except LaserTilted:
            return None
        except TransformError:
            return self._scan[1] if self._scan is not None and abs(scan.stamp - self._scan[0].stamp) < 0.5 else None
        self._scan = scan, ScanView(scan=level.scan, map_from_laser=level.pose)
        return self._scan[1]

    def take(self, now: float, *, is_busy: bool) -> tuple[Frame, ...]:
        """The frames that are ready; without a mission nothing is measured."""
        out: list[Frame] = []
        while self._waiting:
            pending = self._waiting[0]
            ready = self._see(pending, now) if is_busy else pending.frame
            if ready is None:
                break
            self._waiting.popleft()
            out.append(ready)
        return tuple(out)

    def _see(self, pending: _Pending, now: float) -> Frame | None:
        """The frame with eye and places, None where it has to wait."""
        frame, camera = pending.frame, self._camera
        if camera is None or pending.stamp <= 0.0:
            return frame
        pose = self._pose_of(camera.frame, pending.stamp)
        if pose is None:
            return None if now - pending.came < HELD else frame
        view = View(camera.lens, pose)
        frame = replace(frame, eye=_eye(view, camera.lens))
        off = self._off()
        boxes = tuple(measure(box, view, None, off) if box.label in self._classes else box for box in frame.boxes)
        return replace(frame, boxes=boxes)

    def _pose_of(self, frame: str, stamp: float) -> Array | None:
        """Of the camera in map at a moment, z from the floor, shape (4, 4); None where it is not known."""
        world, odom = self._frames.map_frame, self._frames.odom_frame
        try:
            pose = self._tree.transform(world, frame, stamp).matrix
        except TransformError:
            try:  # the map's part of it comes later than odometry
                self._place.map_from_odom(stamp)  # raises where it is too old
                pose = self._tree.transform(world, odom).matrix @ self._tree.transform(odom, frame, stamp).matrix
            except TransformError:
                return None
        pose[2, 3] -= self._topics.floor_height
        return pose

    def _off(self) -> Array | None:
        """What the lidar hits where the map shows nothing [m]."""
        if self._scan is None or self.house is None:
            return None
        view = self._scan[1]
        points = transform_points(view.map_from_laser, scan_points(view.scan))
        return off_the_map(self.house.floor, points, self._topics.off_map)


def _eye(view: View, lens: Lens) -> Eye:
    pose = view.map_from_optical
    return Eye(pose=Pose2D(float(pose[0, 3]), float(pose[1, 3]), view.yaw), width=lens.view_width, columns=lens.width)
