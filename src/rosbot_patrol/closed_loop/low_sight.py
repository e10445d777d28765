"""What a simulated robot sees besides the lidar, brought to costmaps and guard as its nodes do: depth and ranges."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from rosbot_patrol.control import collision_guard
from rosbot_patrol.control.collision_guard import CollisionGuard
from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.costmap.inputs import DepthInput, RangeInput
from rosbot_patrol.costmap.records import DepthRecord, OpticsRecord, RangeRecord
from rosbot_patrol.costmap.sources.depth import Optics
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scene.matrices import to_pose2d

log = logging.getLogger(__name__)

_RANGES = 0.2  # between two readings [s]
_PICTURES = 0.1  # between two pictures of the camera [s]; a source's max_rate may leave some out


class LowSight:
    """Range sensors and depth pictures of an engine, at the simulator's rates.

    Args:
        engine: with the robot in it. Without a renderer there are no pictures.
        costmaps: with inputs for them, or not.
        guard: stops for the range sensors.
    """

    def __init__(self, engine: Engine, costmaps: Sequence[FedCostmap], guard: CollisionGuard) -> None:
        self._engine, self._guard = engine, guard
        self._next_ranges = self._next_picture = 0.0
        inputs = [each for costmap in costmaps for each in costmap.inputs]
        self._ranges = [each for each in inputs if isinstance(each, RangeInput)]
        self._depths = [each for each in inputs if isinstance(each, DepthInput)]
        self._has_camera = engine.has_camera and engine.robot.description.camera is not None
        if self._depths and not self._has_camera:
            log.warning("a costmap wants depth pictures, and the engine has no renderer or the robot no camera")
        k, size = engine.params.camera.intrinsics, engine.params.camera
        for each in self._depths:
            each.hear_optics(OpticsRecord(size.width, size.height, Optics(k.fx, k.fy, k.cx, k.cy)))

    def look(self, now: float, odom_from_base: Pose2D) -> None:
        """Take what is due.

        Args:
            now: time [s].
            odom_from_base: for the guard.
        """
        if now >= self._next_ranges - 1e-6:
            self._next_ranges = now + _RANGES
            self._hear(now, odom_from_base)
        if self._has_camera and now >= self._next_picture - 1e-6:
            self._next_picture = now + _PICTURES
            self._picture(now)

    def _hear(self, now: float, odom_from_base: Pose2D) -> None:
        p, mounts = self._engine.params.range, self._engine.robot.description.ranges
        distances = self._engine.ranges() if mounts else {}
        for mount in mounts:
            distance = distances[mount.frame]
            reading = collision_guard.RangeReading(distance, p.range_min, p.range_max, to_pose2d(mount.pose))
            self._guard.see_range(mount.frame, reading, now, odom_from_base)
            for each in self._ranges:
                if each.topic.strip("/").replace("/", "_") == mount.frame:  # as the simulator names them
                    each.hear(RangeRecord(now, mount.frame, distance, p.range_min, p.range_max, p.field_of_view), now)

    def _picture(self, now: float) -> None:
        wanting = [each for each in self._depths if each.is_due(now)]
        mount = self._engine.robot.description.camera
        if not wanting or mount is None:
            return
        depth = self._engine.picture(colour=False).depth
        height, width = depth.shape
        data = np.ascontiguousarray(depth, "<f4").view(np.uint8).ravel()
        record = DepthRecord(now, mount.frame, width, height, "32FC1", 4 * width, data)
        for each in wanting:
            each.hear(record, now)
