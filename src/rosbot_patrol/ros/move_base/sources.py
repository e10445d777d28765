"""What a costmap on ROS sees by: topics whose messages wait for their transform and then go into a layer.

Callbacks only decode what is used of a message (of a depth picture every n-th row and column) and keep the newest few;
the costmap's own loop places them, at their stamps, when it updates.
"""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud, PointCloud2, Range
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import ObservationBuffer, ObstacleLayer, height_problem, observe_level
from rosbot_patrol.costmap.layers.range_layer import RangeReading, RangeSensorLayer
from rosbot_patrol.costmap.sensor_params import DepthSourceParams
from rosbot_patrol.costmap.sources.cloud import CloudLayout, cloud_points, observe_cloud
from rosbot_patrol.costmap.sources.depth import DepthPicture, Optics, observe_depth
from rosbot_patrol.errors import ImageError, LaserTilted, SensorError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.ros.messages.convert import scan_from_msg
from rosbot_patrol.ros.messages.images import picture_from_msg
from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.ros.runtime.transforms import NO_FRAME, Transforms
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck

log = logging.getLogger(__name__)

T = TypeVar("T")

_KEPT = 5  # messages that wait for their transform
_OLDEST = 1.0  # older than the newest that waits by more, a message waits no longer [s]
_PATIENCE = 1.0  # where the parameters set no limit, scans that say nothing stop the robot after so long [s]
_SILENT = 5.0  # where the parameters set no limit, a topic silent for so long is told of [s]


class Source(ABC, Generic[T]):
    """A topic of a layer.

    Args:
        name: "layer/source", for messages.
        limit: silence that stops the robot [s], 0 for none.
        frame: of the sensor, "" for the message's.
        max_rate: so many messages a second are looked at, 0 for all.
        newest_only: of several messages only the newest counts.
    """

    def __init__(
        self, name: str, *, limit: float = 0.0, frame: str = "", max_rate: float = 0.0, newest_only: bool = True
    ) -> None:
        self.name = name
        self.refused = ""
        self._limit = limit
        self._frame = frame.lstrip("/")
        self._period = 0.95 / max_rate if max_rate > 0.0 else 0.0
        self._newest_only = newest_only
        self._heard = self._used = -math.inf
        self._born = self._placed = now()
        self._unplaced = ""
        self._waiting: deque[tuple[float, str, T]] = deque(maxlen=_KEPT)

    @abstractmethod
    def _place(self, item: T, stamp: float, frame: str, transforms: Transforms, target: str) -> None:
        """Put it into the layer; raises TransformError where it cannot be placed yet."""

    @abstractmethod
    def _decode(self, msg: rospy.Message) -> T | None:
        """What is kept of a message, None for nothing; raises ImageError or SensorError."""

    def receive(self, msg: rospy.Message) -> None:
        """Callback of the topic."""
        stamp = msg.header.stamp.to_sec()
        self._heard = now()
        if 0.0 <= stamp - self._used < self._period:
            return
        try:
            item = self._decode(msg)
        except (ImageError, SensorError) as err:
            if not self.refused:
                log.error("%s: %s", self.name, err)
            self.refused = str(err)
            return
        self.refused = ""
        if item is not None:
            self._used = stamp
            self._waiting.append((stamp, self._frame or msg.header.frame_id.lstrip("/"), item))

    def take(self, transforms: Transforms, target: str) -> None:
        """Place what waits, in the frame `target`; what cannot be placed yet waits on."""
        later: list[tuple[float, str, T]] = []
        waiting = list(self._waiting)
        for entry in reversed(waiting) if self._newest_only else waiting:
            stamp, frame, item = entry
            try:
                self._place(item, stamp, frame, transforms, target)
            except TransformError as err:
                self._unplaced = self._unplaced or str(err)
                later.append(entry)
                continue
            self._placed, self._unplaced = now(), ""
            if self._newest_only:
                break
        newest = max((entry[0] for entry in later), default=0.0)
        later.sort(key=lambda entry: entry[0])
        self._waiting = deque((e for e in later if newest - e[0] < _OLDEST), maxlen=_KEPT)

    def trouble(self, time: float) -> str:
        """What is wrong with it, "" for nothing."""
        if self.refused:
            return f"{self.name}: {self.refused}"
        limit = self._limit or _SILENT
        silent = time - max(self._heard, self._born)
        if silent > limit:
            return f"{self.name} has been silent for {silent:.1f} s"
        if self._unplaced and time - self._placed > limit:
            return f"{self.name} cannot be placed: {self._unplaced}"
        return ""

    def blind(self, time: float) -> bool:
        """Whether nothing can be seen by it though messages come, so that the robot has to stand."""
        del time
        return False


class _Scans(Source[LaserScan]):
    """Scans; those that say nothing, or of a laser that cannot be laid level, are as none and stop the robot."""

    def __init__(self, name: str, buffer: ObservationBuffer, layer: ObstacleLayer) -> None:
        p = buffer.params
        super().__init__(
            name,
            limit=p.expected_update_rate,
            frame=p.sensor_frame,
            max_rate=p.max_rate,
            newest_only=p.observation_persistence == 0.0,
        )
        self._buffer, self._layer = buffer, layer
        self._check = ScanCheck(f"{name} sees nothing by it")
        rospy.Subscriber(p.topic, LaserScanMsg, self.receive, queue_size=1, buff_size=2**18, tcp_nodelay=True)

    def _decode(self, msg: LaserScanMsg) -> LaserScan | None:
        scan = scan_from_msg(msg)
        return scan if self._check.accepts(scan, now()) else None

    def _place(self, item: LaserScan, stamp: float, frame: str, transforms: Transforms, target: str) -> None:
        p = self._buffer.params
        try:
            level = level_scan(replace(item, frame_id=frame), transforms.transform(target, frame, stamp), target)
            problem = height_problem(level, p)
        except LaserTilted as err:
            problem = str(err)
        if problem:
            self._check.refuse(problem, now())
            return
        self._check.clear(now())
        self._buffer.add(observe_level(level, p, self._layer.params.max_obstacle_height))

    def trouble(self, time: float) -> str:
        """What is wrong with it, "" for nothing."""
        return f"{self.name}: {self._check.problem}" if self._check.problem else super().trouble(time)

    def blind(self, time: float) -> bool:
        """Whether nothing can be seen by it though scans come."""
        return self._check.lasts(time, self._limit or _PATIENCE)


class _Clouds(Source["NDArray[np.float64]"]):
    def __init__(self, name: str, buffer: ObservationBuffer, layer: ObstacleLayer) -> None:
        p = buffer.params
        super().__init__(
            name,
            limit=p.expected_update_rate,
            frame=p.sensor_frame,
            max_rate=p.max_rate,
            newest_only=p.observation_persistence == 0.0,
        )
        self._buffer, self._layer = buffer, layer
        kind = PointCloud2 if p.data_type == "PointCloud2" else PointCloud
        rospy.Subscriber(p.topic, kind, self.receive, queue_size=1, buff_size=2**24, tcp_nodelay=True)

    def _decode(self, msg: PointCloud2 | PointCloud) -> NDArray[np.float64]:
        stride = self._buffer.params.stride
        if isinstance(msg, PointCloud):
            points = np.array([(p.x, p.y, p.z) for p in msg.points[::stride]], np.float64).reshape(-1, 3)
            return points[np.isfinite(points).all(axis=1)]
        fields = {field.name: (field.offset, field.datatype) for field in msg.fields}
        layout = CloudLayout(msg.width, msg.height, fields, msg.point_step, msg.row_step, bool(msg.is_bigendian))
        return cloud_points(msg.data, layout, stride)

    def _place(self, item: NDArray[np.float64], stamp: float, frame: str, transforms: Transforms, target: str) -> None:
        matrix = transforms.lookup_matrix(target, frame, stamp)
        top = self._layer.params.max_obstacle_height
        self._buffer.add(observe_cloud(item, matrix, self._buffer.params, stamp=stamp, top=top))


class _Depths(Source[DepthPicture]):
    """Depth pictures, with the optics that camera_info gives once."""

    def __init__(self, name: str, buffer: ObservationBuffer, params: DepthSourceParams) -> None:
        super().__init__(name, limit=params.expected_update_rate, frame=params.sensor_frame, max_rate=params.max_rate)
        self._buffer, self._params = buffer, params
        self._info: CameraInfo | None = None
        beside = params.topic[: params.topic.rfind("/") + 1]
        self._info_topic = params.camera_info_topic or f"{beside}camera_info"
        self._info_subscriber: rospy.Subscriber | None = None
        self._ask_info()
        rospy.Subscriber(params.topic, Image, self.receive, queue_size=1, buff_size=2**22, tcp_nodelay=True)

    def _ask_info(self) -> None:
        if self._info_subscriber is None:
            self._info_subscriber = rospy.Subscriber(self._info_topic, CameraInfo, self._on_info, queue_size=1)

    def _on_info(self, msg: CameraInfo) -> None:
        self._info = msg
        if self._info_subscriber is not None:
            self._info_subscriber.unregister()
            self._info_subscriber = None

    def _decode(self, msg: Image) -> DepthPicture | None:
        info = self._info
        if info is None or (info.width, info.height) != (msg.width, msg.height):
            self._ask_info()
            if info is None and now() - self._born < _SILENT:
                return None
            said = "none has come" if info is None else f"it tells of {info.width} x {info.height} pixels"
            raise ImageError(f"a picture of {msg.width} x {msg.height} needs its {self._info_topic}, {said}")
        picture = picture_from_msg(msg)
        if picture.encoding not in ("32FC1", "16UC1", "mono16"):
            raise ImageError(f"pictures are {picture.encoding}, expected depth as 32FC1 or 16UC1")
        if not (info.K[0] > 0.0 and info.K[4] > 0.0):
            raise ImageError(f"{self._info_topic} tells no focal length, the camera is not calibrated")
        optics = Optics(info.K[0], info.K[4], info.K[2], info.K[5])
        stamp = msg.header.stamp.to_sec()
        return DepthPicture.of(picture.pixels[:, :, 0], optics, stride=self._params.stride, stamp=stamp)

    def _place(self, item: DepthPicture, stamp: float, frame: str, transforms: Transforms, target: str) -> None:
        matrix = transforms.lookup_matrix(target, frame, stamp)
        self._buffer.add(observe_depth(item, matrix, self._params))


class _Ranges(Source[Range]):
    def __init__(self, name: str, topic: str, layer: RangeSensorLayer) -> None:
        super().__init__(name, limit=layer.params.no_readings_timeout, newest_only=False)
        self._layer = layer
        rospy.Subscriber(topic, Range, self.receive, queue_size=1, tcp_nodelay=True)

    def _decode(self, msg: Range) -> Range:
        if not msg.header.frame_id.strip("/"):
            raise SensorError(f"its messages name no frame: {NO_FRAME}")
        return msg

    def _place(self, item: Range, stamp: float, frame: str, transforms: Transforms, target: str) -> None:
        pose: Pose2D = transforms.lookup(target, frame, stamp)
        self._layer.add(RangeReading(stamp, pose, item.range, item.min_range, item.max_range, item.field_of_view))


def subscribe_sources(costmap: LayeredCostmap) -> list[Source]:
    """Subscribe to everything that a costmap's layers see by."""
    sources: list[Source] = []
    for layer in costmap.obstacle_layers:
        for key, buffer in layer.buffers.items():
            name = f"{layer.name}/{key}"
            if isinstance(buffer.params, DepthSourceParams):
                sources.append(_Depths(name, buffer, buffer.params))
            elif buffer.params.data_type == "LaserScan":
                sources.append(_Scans(name, buffer, layer))
            else:
                sources.append(_Clouds(name, buffer, layer))
    for ranges in costmap.range_layers:
        sources += [_Ranges(f"{ranges.name}{topic}", topic, ranges) for topic in ranges.topics]
    return sources
