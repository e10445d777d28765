"""A patrol that is seen by camera, lidar and depth, as messages of a bag: the world of `made_patrol` in a long hall."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from made_patrol import BOXES, COUNT, RecordedWorld

from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
WIDE, HIGH, FOCAL = 160, 120, 80.0
SHARE = 0.4  # of the colour picture's size, for depth
BOX = 72, 11, 88, 67  # of somebody 1.7 m tall at NEAR, seen from 0.22 m over the floor
DEPTH_TOPIC, DEPTH_INFO = "/camera/depth/image_raw", "/camera/depth/camera_info"
NEAR, FAR = 2.4, 4.0  # of the body and of what is behind it [m]


def hall() -> Grid:
    """50 x 20 m of floor that hold all room points, within walls."""
    cells = np.zeros((100, 250), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    return Grid(GridInfo(resolution=0.2, width=250, height=100, origin_x=-10.0, origin_y=-10.0), cells)


class SightedWorld(RecordedWorld):
    """The world with a lens, a lidar and a map, and with depth on demand.

    Args:
        has_depth: depth pictures are recorded while somebody is there.
        is_flat: what the depth camera sees is a picture on a wall.
    """

    def __init__(self, *, has_depth: bool = False, is_flat: bool = False, **given: Any) -> None:
        super().__init__(**given)
        self._has_depth, self._is_flat = has_depth, is_flat
        make = self._make
        mounts = ("camera", 0.18, (-0.5, 0.5, -0.5, 0.5)), ("laser", 0.1, (0.0, 0.0, 0.0, 1.0))
        edges = [make.transform("base_link", child, self.now, (0.0, 0.0, z), turn) for child, z, turn in mounts]
        self._put(0.0, "/tf_static", make.tf(*edges))
        self._put(0.0, "/map", make.map(hall()))
        self._put(0.0, "/camera/rgb/camera_info", self._info(1.0))
        if has_depth:
            self._put(0.0, DEPTH_INFO, self._info(SHARE))

    def _info(self, share: float) -> Any:
        make, wide, high, focal = self._make, round(share * WIDE), round(share * HIGH), share * FOCAL
        k = np.array([focal, 0, wide / 2, 0, focal, high / 2, 0, 0, 1], dtype=np.float64)
        region = make.new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        rest = k, np.eye(3).ravel(), np.zeros(12), 0, 0, region
        return make.new(INFO, make.header(self.now, "camera"), high, wide, "plumb_bob", np.zeros(5), *rest)

    def step(self) -> Any:
        tick = round(self.now * 25)
        if tick % 3 == 0:
            self._put(-0.0055, "/scan", self._make.scan(self._scan()))
        if self._has_depth and tick % 3 == 0 and self.person_when(self):
            self._put(-0.0045, DEPTH_TOPIC, self._depth())
        return super().step()

    def _scan(self) -> LaserScan:
        """The hall's side walls, and a leg before the robot where somebody is."""
        angles = -math.pi + math.tau / 360 * np.arange(360)
        with np.errstate(divide="ignore"):
            ranges = np.minimum(10.0 / np.abs(np.sin(angles + self.yaw)), 11.0)
        if self.person_when(self):
            ranges[np.abs(angles) < 0.05] = NEAR
        values = {"stamp": self.now - 0.05, "frame_id": "laser", "range_min": 0.1, "range_max": 12.0}
        return LaserScan(**values, angle_min=-math.pi, angle_increment=math.tau / 360, ranges=ranges)

    def _depth(self) -> Any:
        high, wide = round(SHARE * HIGH), round(SHARE * WIDE)
        rows, columns = np.mgrid[0:high, 0:wide] / SHARE
        left, top, right, bottom = BOX
        is_body = (columns >= left + 2) & (columns < right - 2) & (rows >= top) & (rows < bottom)
        body = np.where(is_body, NEAR, FAR) + 0.1 * np.sin(rows / 4.0)
        metres = np.full((high, wide), NEAR) if self._is_flat else body
        pixels = np.round(1000.0 * metres).astype(np.uint16).view(np.uint8).ravel()
        header = self._make.header(self.now - 0.05, "camera")
        return self._make.new(IMAGE, header, high, wide, "16UC1", 0, 2 * wide, pixels)

    def _see(self, now: float) -> None:
        make, picture = self._make, self._make.header(now - 0.05, "camera")
        count = 1 if self.person_when(self) else 0
        if count:
            box = make.new("darknet_ros_msgs/msg/BoundingBox", 0.9, *BOX, 0, "person")
            self._put(-0.003, "/darknet_ros/bounding_boxes", make.new(BOXES, picture, picture, [box]))
        self._put(-0.002, "/darknet_ros/found_object", make.new(COUNT, picture, count))
