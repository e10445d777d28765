"""Sensor inputs of a costmap: records of scans, clouds, depth images and ranges that wait for their transform.

`hear` decodes only the used part of a record (of a depth image every n-th row and column) and keeps the newest few.
`take` adds them to the costmap's layers at their stamps. One thread may hear while another takes.
"""

from __future__ import annotations

import logging
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import ObservationBuffer, ObstacleLayer, height_problem, observe_level
from rosbot_patrol.costmap.layers.range_layer import RangeReading, RangeSensorLayer
from rosbot_patrol.costmap.records import CloudRecord, DepthRecord, OpticsRecord, RangeRecord
from rosbot_patrol.costmap.sensor_params import DepthSourceParams, SourceParams
from rosbot_patrol.costmap.sources.cloud import cloud_points, observe_cloud
from rosbot_patrol.costmap.sources.depth import DepthPicture, observe_depth
from rosbot_patrol.errors import ImageError, LaserTilted, SensorError, TransformError
from rosbot_patrol.images.encodings import unpack
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.tf.frames import NO_FRAME, Frames

log = logging.getLogger(__name__)

T = TypeVar("T")

_KEPT = 5  # maximum number of records that wait for their transform
_OLDEST = 1.0  # a record older than the newest waiting one by more is dropped [s]
_PATIENCE = 1.0  # without a limit in the parameters, unusable scans stop the robot after this time [s]
_SILENT = 5.0  # without a limit in the parameters, an input silent for this time is reported [s]


@dataclass(frozen=True)
class _Waiting(Generic[T]):
    """What is kept of a record until its transform is known."""

    stamp: float
    frame: str
    item: T


class Input(ABC, Generic[T]):
    """One topic of a layer. All times [s] are of one clock.

    Args:
        name: "layer/source", for messages.
        topic: where its records come from.
        now: time at the start.
        limit: silence that stops the robot [s], 0: none.
        frame: of the sensor, "": the record's.
        max_rate: maximum rate of records used [1/s], 0: all.
        newest_only: of several records use only the newest.

    Attributes:
        refused: reason why the newest record cannot be used, "" if it can.
    """

    def __init__(
        self,
        name: str,
        topic: str,
        now: float,
        *,
        limit: float = 0.0,
        frame: str = "",
        max_rate: float = 0.0,
        newest_only: bool = True,
    ) -> None:
        self.name, self.topic = name, topic
        self.refused = ""
        self._limit = limit
        self._frame = frame.lstrip("/")
        self._period = 0.95 / max_rate if max_rate > 0.0 else 0.0
        self._newest_only = newest_only
        self._heard = self._used = -math.inf
        self._born = self._placed = now
        self._unplaced = ""
        self._waiting: deque[_Waiting[T]] = deque(maxlen=_KEPT)

    @abstractmethod
    def _place(self, entry: _Waiting[T], frames: Frames, target: str, now: float) -> None:
        """Put it into the layer; raises TransformError if it cannot be placed yet."""

    def is_due(self, stamp: float) -> bool:
        """Whether a record of a time [s] will be looked at, by `max_rate`."""
        return not 0.0 <= stamp - self._used < self._period

    def _keep(self, stamp: float, frame: str, now: float, decode: Callable[[], T | None]) -> None:
        """Decode a record, unless records come too fast, and queue it; `decode` may raise ImageError or SensorError."""
        self._heard = now
        if not self.is_due(stamp):
            return
        try:
            item = decode()
        except (ImageError, SensorError) as err:
            if not self.refused:
                log.error("%s: %s", self.name, err)
            self.refused = str(err)
            return
        self.refused = ""
        if item is not None:
            self._used = stamp
            self._waiting.append(_Waiting(stamp, self._frame or frame, item))

    def take(self, frames: Frames, target: str, now: float) -> None:
        """Place the waiting records in the frame `target`; those that cannot be placed yet keep waiting."""
        later: list[_Waiting[T]] = []
        waiting = list(self._waiting)
        for entry in reversed(waiting) if self._newest_only else waiting:
            try:
                self._place(entry, frames, target, now)
            except TransformError as err:
                self._unplaced = self._unplaced or str(err)
                later.append(entry)
                continue
            self._placed, self._unplaced = now, ""
            if self._newest_only:
                break
        newest = max((entry.stamp for entry in later), default=0.0)
        later.sort(key=lambda entry: entry.stamp)
        self._waiting = deque((e for e in later if newest - e.stamp < _OLDEST), maxlen=_KEPT)

    def trouble(self, now: float) -> str:
        """Description of a problem, "" for none."""
        if self.refused:
            return f"{self.name}: {self.refused}"
        limit = self._limit or _SILENT
        silent = now - max(self._heard, self._born)
        if silent > limit:
            return f"{self.name} has been silent for {silent:.1f} s"
        if self._unplaced and now - self._placed > limit:
            return f"{self.name} cannot be placed: {self._unplaced}"
        return ""

    def is_blind(self, now: float) -> bool:
        """Whether no record is usable although records arrive, so that the robot must stop."""
        del now
        return False


class _ObstacleInput(Input[T]):
    """An input of an obstacle layer's source."""

    def __init__(self, name: str, now: float, buffer: ObservationBuffer, layer: ObstacleLayer) -> None:
        p = buffer.params
        super().__init__(
            name,
            p.topic,
            now,
            limit=p.expected_update_rate,
            frame=p.sensor_frame,
            max_rate=p.max_rate,
            newest_only=p.observation_persistence == 0.0,
        )
        self._buffer, self._layer = buffer, layer

    @property
    def params(self) -> SourceParams:
        """Parameters of the source."""
        return self._buffer.params

    @property
    def _top(self) -> float:
        highest: float = self._layer.params.max_obstacle_height
        return highest


class ScanInput(_ObstacleInput[LaserScan]):
    """Scans; unusable ones, or those of a tilted laser, count as missing and stop the robot."""

    def __init__(self, name: str, now: float, buffer: ObservationBuffer, layer: ObstacleLayer) -> None:
        super().__init__(name, now, buffer, layer)
        self._check = ScanCheck(f"{name} sees nothing by it")

    def hear(self, scan: LaserScan, now: float) -> None:
        """Keep a scan until the next update."""
        self._keep(scan.stamp, scan.frame_id, now, lambda: scan if self._check.accepts(scan, now) else None)

    def _place(self, entry: _Waiting[LaserScan], frames: Frames, target: str, now: float) -> None:
        scan = replace(entry.item, frame_id=entry.frame)
        try:
            level = level_scan(scan, frames.transform(target, entry.frame, entry.stamp), target)
            problem = height_problem(level, self.params)
        except LaserTilted as err:
            problem = str(err)
        if problem:
            self._check.refuse(problem, now)
            return
        self._check.clear(now)
        self._buffer.add(observe_level(level, self.params, self._top))

    def trouble(self, now: float) -> str:
        """Description of a problem, "" for none."""
        return f"{self.name}: {self._check.problem}" if self._check.problem else super().trouble(now)

    def is_blind(self, now: float) -> bool:
        """Whether no scan is usable although scans arrive."""
        return self._check.lasts(now, self._limit or _PATIENCE)


class CloudInput(_ObstacleInput["NDArray[np.float64]"]):
    """Point clouds."""

    def hear(self, record: CloudRecord, now: float) -> None:
        """Keep a cloud until the next update."""
        self._keep(record.stamp, record.frame, now, lambda: self._points(record))

    def _points(self, record: CloudRecord) -> NDArray[np.float64]:
        stride = self.params.stride
        if record.layout is not None:
            return cloud_points(record.data, record.layout, stride)
        points = np.array([(p.x, p.y, p.z) for p in record.data[::stride]], np.float64).reshape(-1, 3)
        finite: NDArray[np.float64] = points[np.isfinite(points).all(axis=1)]
        return finite

    def _place(self, entry: _Waiting[NDArray[np.float64]], frames: Frames, target: str, now: float) -> None:
        del now
        matrix = frames.transform(target, entry.frame, entry.stamp).matrix
        self._buffer.add(observe_cloud(entry.item, matrix, self.params, stamp=entry.stamp, top=self._top))


class DepthInput(Input[DepthPicture]):
    """Depth images, with the camera's calibration, which must arrive once.

    Attributes:
        wants_optics: whether it waits for `hear_optics`.
        optics_topic: topic of the calibration.
    """

    def __init__(self, name: str, now: float, buffer: ObservationBuffer, params: DepthSourceParams) -> None:
        super().__init__(
            name,
            params.topic,
            now,
            limit=params.expected_update_rate,
            frame=params.sensor_frame,
            max_rate=params.max_rate,
        )
        self._buffer, self.params = buffer, params
        self._optics: OpticsRecord | None = None
        beside = params.topic[: params.topic.rfind("/") + 1]
        self.optics_topic = params.camera_info_topic or f"{beside}camera_info"
        self.wants_optics = True

    def hear_optics(self, record: OpticsRecord) -> None:
        """Set the camera's calibration."""
        self._optics, self.wants_optics = record, False

    def hear(self, record: DepthRecord, now: float) -> None:
        """Keep an image until the next update."""
        self._keep(record.stamp, record.frame, now, lambda: self._picture(record, now))

    def _picture(self, record: DepthRecord, now: float) -> DepthPicture | None:
        known, size = self._optics, (record.width, record.height)
        if known is None or (known.width, known.height) != size:
            self.wants_optics = True
            if known is None and now - self._born < _SILENT:
                return None
            said = "none has come" if known is None else f"it tells of {known.width} x {known.height} pixels"
            raise ImageError(f"a picture of {size[0]} x {size[1]} needs its {self.optics_topic}, {said}")
        picture = unpack(
            record.data, record.encoding, width=size[0], height=size[1], step=record.step,
            big_endian=record.is_bigendian,
        )  # fmt: skip
        if picture.encoding not in ("32FC1", "16UC1", "mono16"):
            raise ImageError(f"pictures are {picture.encoding}, expected depth as 32FC1 or 16UC1")
        if not (known.optics.fx > 0.0 and known.optics.fy > 0.0):
            raise ImageError(f"{self.optics_topic} tells no focal length, the camera is not calibrated")
        return DepthPicture.of(picture.pixels[:, :, 0], known.optics, stride=self.params.stride, stamp=record.stamp)

    def _place(self, entry: _Waiting[DepthPicture], frames: Frames, target: str, now: float) -> None:
        del now
        matrix = frames.transform(target, entry.frame, entry.stamp).matrix
        self._buffer.add(observe_depth(entry.item, matrix, self.params))


class RangeInput(Input[RangeRecord]):
    """Readings of range sensors."""

    def __init__(self, name: str, now: float, topic: str, layer: RangeSensorLayer) -> None:
        super().__init__(name, topic, now, limit=layer.params.no_readings_timeout, newest_only=False)
        self._layer = layer

    def hear(self, record: RangeRecord, now: float) -> None:
        """Keep a reading until the next update."""
        self._keep(record.stamp, record.frame, now, lambda: _framed(record))

    def _place(self, entry: _Waiting[RangeRecord], frames: Frames, target: str, now: float) -> None:
        del now
        pose, r = frames.lookup(target, entry.frame, entry.stamp), entry.item
        self._layer.add(RangeReading(r.stamp, pose, r.distance, r.range_min, r.range_max, r.field_of_view))


def _framed(record: RangeRecord) -> RangeRecord:
    if not record.frame:
        raise SensorError(f"its messages name no frame: {NO_FRAME}")
    return record


def make_inputs(costmap: LayeredCostmap, now: float) -> Sequence[Input[Any]]:
    """Inputs of all layers of a costmap; silence counts from `now` [s]."""
    inputs: list[Input[Any]] = []
    for layer in costmap.obstacle_layers:
        for key, buffer in layer.buffers.items():
            name = f"{layer.name}/{key}"
            if isinstance(buffer.params, DepthSourceParams):
                inputs.append(DepthInput(name, now, buffer, buffer.params))
            elif buffer.params.data_type == "LaserScan":
                inputs.append(ScanInput(name, now, buffer, layer))
            else:
                inputs.append(CloudInput(name, now, buffer, layer))
    for ranges in costmap.range_layers:
        inputs += [RangeInput(f"{ranges.name}{topic}", now, topic, ranges) for topic in ranges.topics]
    return inputs
