"""Range sensor layer: readings of ultrasonic or infrared sensors, kept as a probability of each cell."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap import costmap_kernels
from rosbot_patrol.costmap.bounds import NOTHING, Bounds
from rosbot_patrol.costmap.costs import FREE, LETHAL, UNKNOWN, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layers import range_kernels as kernels
from rosbot_patrol.costmap.layers.layer import Layer
from rosbot_patrol.costmap.layers.marks import MarkMemory
from rosbot_patrol.costmap.scrolling import ScrollingCells, fill_outside
from rosbot_patrol.costmap.sensor_params import RangeSensorParams
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.scan import is_silent_range

_HALF = 127  # a probability of a half, of 254


@dataclass(frozen=True)
class RangeReading:
    """One sensor_msgs/Range in the costmap's frame.

    Attributes:
        stamp: when it was measured [s].
        pose: of the sensor in the costmap's frame.
        distance: reading [m]; -inf: nearer than it can measure, inf: nothing (REP 117).
        range_min: shortest reading [m].
        range_max: longest reading [m]; if both are equal, the sensor only switches.
        field_of_view: opening angle of the cone [rad].
    """

    stamp: float
    pose: Pose2D
    distance: float
    range_min: float
    range_max: float
    field_of_view: float

    @property
    def is_fixed(self) -> bool:
        """Whether the sensor only switches: something is nearer than its fixed distance, or not."""
        return self.range_min == self.range_max


class RangeSensorLayer(Layer):
    """Matches range_sensor_layer::RangeSensorLayer 0.5: Bayesian updates over each reading's cone.

    A cell's probability starts at one half. Cells nearer than the reading become less probable, cells at the reading
    more; the effect falls with the angle from the cone's axis and with the distance (`phi`). Cells above
    `mark_threshold` are lethal, cells below `clear_threshold` free, the others are ignored; costs combine by maximum.

    Differs:
    - A cell counts by its part nearest to the cone's axis, and an obstacle is at least three quarters of a cell thick.
      Upstream uses the centres of cells; a cone of 0.1 rad contains none near the sensor.
    - Probabilities stay between 3 and 251 of 254; upstream's reach 0 and stay there for ever.
    - A reading of max_range is ignored if `clear_on_max_reading` is false; upstream marks at that distance. A reading
      outside the sensor's own limits is ignored, except -inf.
    - The robot's own cells are reset to one half.
    - `no_readings_timeout` counts from the first update.
    """

    def __init__(self, params: RangeSensorParams, *, name: str = "range_layer") -> None:
        self.name = name
        self.enabled = params.enabled
        self.params = params
        self._info: GridInfo | None = None
        self._footprint: Footprint | None = None
        self._window = ScrollingCells(1, 1, _HALF)
        self._dirty = NOTHING
        self._waiting: list[RangeReading] = []
        self._heard: float | None = None
        self._memory = MarkMemory(0.0, params.pixel_decay) if params.use_decay else None
        values = np.arange(256)
        self._table = np.full(256, UNKNOWN, np.uint8)
        self._table[values < params.clear_threshold * 254.0] = FREE
        self._table[values > params.mark_threshold * 254.0] = LETHAL

    @property
    def topics(self) -> list[str]:
        """Topics of the sensors."""
        ns = self.params.ns.rstrip("/")
        return [f"{ns}/{topic.lstrip('/')}" if ns else topic for topic in self.params.topics]

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """Probability of each cell, shape (height, width)."""
        return self._window.cells / 254.0

    def add(self, reading: RangeReading) -> None:
        """Store a reading for the next update."""
        kind = self.params.input_sensor_type
        if kind != "ALL" and reading.is_fixed != (kind == "FIXED"):
            return
        self._waiting.append(reading)

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Adopt the master's place and size."""
        self._info, self._footprint = info, footprint
        self._window = ScrollingCells(info.height, info.width, _HALF)
        if self._memory is not None:
            self._memory.clear()
        self._dirty = Bounds(0, 0, info.width, info.height)

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the rolling window."""
        self._info = info
        self._window.shift(dx, dy)
        if self._memory is not None:
            self._memory.move(dx, dy)
        self._dirty = NOTHING if self._dirty.is_empty else Bounds(0, 0, info.width, info.height)

    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Grow the bounds by the cells that readings changed."""
        info = self._info
        if info is None:
            return bounds
        if self._heard is None or now < self._heard:
            self._heard = now
        big = np.iinfo(np.int64)
        changes = np.array([big.max, big.max, big.min, big.min, 0], np.int64)
        readings, self._waiting = self._waiting, []
        for reading in readings:
            self._heard = max(self._heard, reading.stamp)
            self._use(info, reading, changes)
        self._forget(now, info, readings, changes)
        self._free_robot(info, pose, changes)
        area = NOTHING if changes[0] >= changes[2] else Bounds(*changes[:4].tolist())
        touched, self._dirty = self._dirty.union(area), NOTHING
        return bounds.union(touched.clipped(info.width, info.height))

    def _use(self, info: GridInfo, reading: RangeReading, changes: NDArray[np.int64]) -> None:
        distance, is_clear = reading.distance, False
        if is_silent_range(distance):
            return
        if reading.is_fixed:
            is_clear, distance = not math.isinf(distance) or distance > 0.0, reading.range_max
        elif distance == -math.inf:
            distance = reading.range_min
        elif distance >= reading.range_max:
            is_clear, distance = True, reading.range_max
        elif distance < reading.range_min:
            return
        if is_clear and not self.params.clear_on_max_reading:
            return
        half = max(reading.field_of_view / 2.0, 1e-3)
        kernels.update_cone(
            self._window.cells, info.resolution, info.origin_x, info.origin_y, *reading.pose, distance, half,
            self.params.phi, self.params.inflate_cone, is_clear, changes,
        )  # fmt: skip

    def _forget(self, now: float, info: GridInfo, readings: list[RangeReading], changes: NDArray[np.int64]) -> None:
        if self._memory is None:
            return
        marked = self._table[self._window.cells]
        if readings and changes[0] < changes[2]:
            x0, y0, x1, y1 = changes[:4].tolist()
            ys, xs = np.nonzero(marked[y0:y1, x0:x1] == LETHAL)
            self._memory.note(now, xs.astype(np.int64) + x0, ys.astype(np.int64) + y0)
        old = self._memory.expired(now, marked, info, [])
        if len(old):
            self._window.cells[old[:, 1], old[:, 0]] = _HALF
            changes[:2] = np.minimum(changes[:2], old.min(axis=0))
            changes[2:4] = np.maximum(changes[2:4], old.max(axis=0) + 1)

    def _free_robot(self, info: GridInfo, pose: Pose2D, changes: NDArray[np.int64]) -> None:
        if self._footprint is None:
            return
        corners = (transform_points(pose, self._footprint.body) - (info.origin_x, info.origin_y)) / info.resolution
        outline = np.ascontiguousarray(corners)
        costmap_kernels.fill_polygon(self._window.cells, outline, _HALF, 0, 0, info.width, info.height, changes)

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write this layer's costs."""
        x0, y0, x1, y1 = bounds
        under, says = master[y0:y1, x0:x1], self._table[self._window.cells[y0:y1, x0:x1]]
        under[(says == FREE) & (under == UNKNOWN)] = FREE
        under[says == LETHAL] = LETHAL

    def reset(self) -> None:
        """Forget all readings."""
        if self._info is not None:
            self.clear_outside(NOTHING)

    def clear_outside(self, keep: Bounds) -> None:
        """Forget sensor data outside an area."""
        if self._info is None:
            return
        fill_outside(self._window.cells, keep, _HALF)
        self._dirty = Bounds(0, 0, self._info.width, self._info.height)

    def is_current(self, now: float) -> bool:
        """Whether readings are as fresh as `no_readings_timeout` demands."""
        limit = self.params.no_readings_timeout
        return limit == 0.0 or (self._heard is not None and now - self._heard <= limit)
