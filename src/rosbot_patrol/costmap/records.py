"""What the messages that a costmap sees by become: plain records that know no ROS. Stamps are in seconds."""

from __future__ import annotations

from typing import Any, NamedTuple

from rosbot_patrol.costmap.sources.cloud import CloudLayout
from rosbot_patrol.costmap.sources.depth import Optics


class CloudRecord(NamedTuple):
    """A sensor_msgs/PointCloud2 (bytes and layout) or PointCloud (points [m], layout None)."""

    stamp: float
    frame: str
    data: Any
    layout: CloudLayout | None = None


class DepthRecord(NamedTuple):
    """A sensor_msgs/Image with depths; `data` is anything with that many bytes."""

    stamp: float
    frame: str
    width: int
    height: int
    encoding: str
    step: int
    data: Any
    is_bigendian: bool = False


class OpticsRecord(NamedTuple):
    """A sensor_msgs/CameraInfo: size and pinhole [px]."""

    width: int
    height: int
    optics: Optics


class RangeRecord(NamedTuple):
    """A sensor_msgs/Range: distance and limits [m], width of the cone [rad]."""

    stamp: float
    frame: str
    distance: float
    range_min: float
    range_max: float
    field_of_view: float
