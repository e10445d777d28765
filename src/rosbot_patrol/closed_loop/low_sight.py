"""What a simulated robot sees besides the lidar, brought to costmaps and guard as its nodes do: depth and ranges."""

from __future__ import annotations

import logging

from rosbot_patrol.control import collision_guard
from rosbot_patrol.control.collision_guard import CollisionGuard
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import ObservationBuffer
from rosbot_patrol.costmap.layers.range_layer import RangeReading
from rosbot_patrol.costmap.sensor_params import DepthSourceParams
from rosbot_patrol.costmap.sources.depth import DepthPicture, Optics, observe_depth
from rosbot_patrol.geometry import Pose2D, compose
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scene.matrices import from_pose2d, to_pose2d

log = logging.getLogger(__name__)

_RANGES = 0.2  # between two readings [s]
_PICTURES = 0.1  # between two pictures of the camera [s]; a source's max_rate may leave some out


class LowSight:
    """Range sensors and depth pictures of an engine, at the simulator's rates.

    Args:
        engine: with the robot in it. Without a renderer there are no pictures.
        costmaps: that have layers for them, or not.
        guard: stops for the range sensors.
    """

    def __init__(self, engine: Engine, costmaps: tuple[LayeredCostmap, ...], guard: CollisionGuard) -> None:
        self._engine, self._costmaps, self._guard = engine, costmaps, guard
        self._next_ranges = self._next_picture = 0.0
        self._used: dict[int, float] = {}
        wants = any(self._depth_buffers(costmap) for costmap in costmaps)
        self._has_camera = engine.has_camera and engine.robot.description.camera is not None
        if wants and not self._has_camera:
            log.warning("a costmap wants depth pictures, and the engine has no renderer or the robot no camera")

    def look(self, now: float, odom_from_base: Pose2D, poses: tuple[Pose2D, ...]) -> None:
        """Take what is due.

        Args:
            now: time [s].
            odom_from_base: for the guard.
            poses: of the robot in the frame of each costmap.
        """
        if now >= self._next_ranges - 1e-6:
            self._next_ranges = now + _RANGES
            self._hear(now, odom_from_base, poses)
        if self._has_camera and now >= self._next_picture - 1e-6:
            self._next_picture = now + _PICTURES
            self._picture(now, poses)

    def _hear(self, now: float, odom_from_base: Pose2D, poses: tuple[Pose2D, ...]) -> None:
        p, mounts = self._engine.params.range, self._engine.robot.description.ranges
        distances = self._engine.ranges() if mounts else {}
        for mount in mounts:
            place, distance = to_pose2d(mount.pose), distances[mount.frame]
            reading = collision_guard.RangeReading(distance, p.range_min, p.range_max, place)
            self._guard.see_range(mount.frame, reading, now, odom_from_base)
            for costmap, pose in zip(self._costmaps, poses, strict=True):
                at = compose(pose, place)
                for layer in costmap.range_layers:
                    layer.add(RangeReading(now, at, distance, p.range_min, p.range_max, p.field_of_view))

    def _picture(self, now: float, poses: tuple[Pose2D, ...]) -> None:
        wants = [
            (buffer, params, pose)
            for costmap, pose in zip(self._costmaps, poses, strict=True)
            for buffer, params in self._depth_buffers(costmap)
            if params.max_rate == 0.0 or now - self._used.get(id(buffer), -1e9) >= 0.95 / params.max_rate
        ]
        mount = self._engine.robot.description.camera
        if not wants or mount is None:
            return
        k = self._engine.params.camera.intrinsics
        optics = Optics(k.fx, k.fy, k.cx, k.cy)
        depth = self._engine.picture(colour=False).depth
        for buffer, params, pose in wants:
            self._used[id(buffer)] = now
            picture = DepthPicture.of(depth, optics, stride=params.stride, stamp=now)
            buffer.add(observe_depth(picture, from_pose2d(pose) @ mount.pose, params))

    @staticmethod
    def _depth_buffers(costmap: LayeredCostmap) -> list[tuple[ObservationBuffer, DepthSourceParams]]:
        return [
            (buffer, buffer.params)
            for layer in costmap.obstacle_layers
            for buffer in layer.buffers.values()
            if isinstance(buffer.params, DepthSourceParams)
        ]
