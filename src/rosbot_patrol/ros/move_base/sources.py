"""Sensor topics of a costmap: each message becomes a record for one of its inputs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from sensor_msgs.msg import CameraInfo, Image, PointCloud, PointCloud2, Range
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.costmap.inputs import CloudInput, DepthInput, RangeInput, ScanInput
from rosbot_patrol.costmap.records import CloudRecord, DepthRecord, OpticsRecord, RangeRecord
from rosbot_patrol.costmap.sources.cloud import CloudLayout
from rosbot_patrol.costmap.sources.depth import Optics
from rosbot_patrol.ros.messages.convert import scan_from_msg
from rosbot_patrol.ros.runtime.node import now


def cloud_from_msg(msg: PointCloud2 | PointCloud) -> CloudRecord:
    """Convert a point cloud to a record; its points are not copied."""
    stamp, frame = msg.header.stamp.to_sec(), msg.header.frame_id.lstrip("/")
    if isinstance(msg, PointCloud):
        return CloudRecord(stamp, frame, msg.points)
    fields = {field.name: (field.offset, field.datatype) for field in msg.fields}
    layout = CloudLayout(msg.width, msg.height, fields, msg.point_step, msg.row_step, bool(msg.is_bigendian))
    return CloudRecord(stamp, frame, msg.data, layout)


def depth_from_msg(msg: Image) -> DepthRecord:
    """Convert a depth picture to a record; its bytes are not copied."""
    return DepthRecord(
        stamp=msg.header.stamp.to_sec(),
        frame=msg.header.frame_id.lstrip("/"),
        width=msg.width,
        height=msg.height,
        encoding=msg.encoding,
        step=msg.step,
        data=msg.data,
        is_bigendian=bool(msg.is_bigendian),
    )


def optics_from_msg(msg: CameraInfo) -> OpticsRecord:
    """The size and pinhole model of a camera."""
    return OpticsRecord(msg.width, msg.height, Optics(msg.K[0], msg.K[4], msg.K[2], msg.K[5]))


def range_from_msg(msg: Range) -> RangeRecord:
    """A reading of a range sensor."""
    return RangeRecord(
        stamp=msg.header.stamp.to_sec(),
        frame=msg.header.frame_id.lstrip("/"),
        distance=msg.range,
        range_min=msg.min_range,
        range_max=msg.max_range,
        field_of_view=msg.field_of_view,
    )


class _DepthTopics:
    """The topic of a depth camera, and its camera_info until the first message of it."""

    def __init__(self, source: DepthInput) -> None:
        self._input = source
        self._info: rospy.Subscriber | None = None
        self._ask_info()
        _subscribe(source.topic, Image, self._on_picture, buff_size=2**22)

    def _on_picture(self, msg: Image) -> None:
        self._input.hear(depth_from_msg(msg), now())
        self._ask_info()

    def _ask_info(self) -> None:
        if self._input.wants_optics and self._info is None:
            self._info = rospy.Subscriber(self._input.optics_topic, CameraInfo, self._on_info, queue_size=1)

    def _on_info(self, msg: CameraInfo) -> None:
        self._input.hear_optics(optics_from_msg(msg))
        if self._info is not None:
            self._info.unregister()
            self._info = None


def _subscribe(topic: str, kind: type, callback: Callable[[Any], None], *, buff_size: int = 2**16) -> None:
    rospy.Subscriber(topic, kind, callback, queue_size=1, buff_size=buff_size, tcp_nodelay=True)


def subscribe_inputs(costmap: FedCostmap) -> None:
    """Subscribe to all inputs of a costmap's layers."""
    for each in costmap.inputs:
        if isinstance(each, ScanInput):
            _subscribe(each.topic, LaserScanMsg, _hearer(each, scan_from_msg), buff_size=2**18)
        elif isinstance(each, CloudInput):
            kind = PointCloud2 if each.params.data_type == "PointCloud2" else PointCloud
            _subscribe(each.topic, kind, _hearer(each, cloud_from_msg), buff_size=2**24)
        elif isinstance(each, DepthInput):
            _DepthTopics(each)
        elif isinstance(each, RangeInput):
            _subscribe(each.topic, Range, _hearer(each, range_from_msg))


def _hearer(each: Any, convert: Callable[[Any], Any]) -> Callable[[Any], None]:
    return lambda msg: each.hear(convert(msg), now())
