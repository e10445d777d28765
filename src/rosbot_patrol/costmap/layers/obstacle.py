"""Obstacle layer: marks what the lidar sees, keeps older marks outside its view."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import NOTHING, Bounds
from rosbot_patrol.costmap.costs import FREE, UNKNOWN, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layers.layer import Layer
from rosbot_patrol.costmap.layers.marks import MarkMemory, Seen
from rosbot_patrol.costmap.params import ObstacleParams, VoxelParams
from rosbot_patrol.costmap.scrolling import ScrollingCells, fill_outside
from rosbot_patrol.costmap.sensor_params import SourceParams
from rosbot_patrol.costmap.sources.depth import DepthObservation
from rosbot_patrol.costmap.sources.observation import (
    Observation,
    ObservationBuffer,
    height_problem,
    observe,
    observe_level,
)
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.grid import GridInfo

__all__ = ["Observation", "ObservationBuffer", "ObstacleLayer", "height_problem", "observe", "observe_level"]

_CLEARED = 1 << 16  # lethal cells that one update can clear without searching for them
_LOW, _HIGH = np.iinfo(np.int64).max, np.iinfo(np.int64).min


class ObstacleLayer(Layer):
    """Matches costmap_2d::ObstacleLayer, and VoxelLayer with planar scans: rays clear, hits mark.

    The robot's own cells are free. The bounds of an update hold the cells with a changed cost, not all cells that rays
    passed: a scan like the previous one changes nothing.

    Differs:
    - Only the robot itself is cleared, without its padding; upstream clears the padding, too, so that a slow robot
      erodes obstacles. Marks of earlier layers under the robot are cleared as well, such as a wall of the map that it
      overlaps by an error of its pose: upstream's robot finds no plan there.
    - `forget_unseen_after`, `forget_out_of_view_after` and `forget_beside_after` forget marks that have not been seen
      again, and `remember_standing` keeps those longer that have stood: see `marks`. They are 0 by default, as
      upstream, which only clears marks by beams.
    """

    def __init__(
        self, params: ObstacleParams, sources: dict[str, SourceParams], *, name: str = "obstacle_layer"
    ) -> None:
        self.name = name
        self.enabled = params.enabled
        self.params = params
        self.buffers = {key: ObservationBuffer(source) for key, source in sources.items()}
        self.has_others = False
        self._default = UNKNOWN if params.track_unknown_space else FREE
        self._window = ScrollingCells(1, 1, self._default)
        self._info: GridInfo | None = None
        self._footprint: Footprint | None = None
        self._dirty = NOTHING
        self._outline: NDArray[np.float64] | None = None
        self._cleared = np.empty(_CLEARED, np.int32)
        ages = params.forget_unseen_after, params.forget_out_of_view_after, params.forget_beside_after
        self._marks = MarkMemory(*ages, params.remember_standing) if max(ages) > 0.0 else None

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Adopt the master's place and size."""
        self._info, self._footprint = info, footprint
        self._window = ScrollingCells(info.height, info.width, self._default)
        self._outline = None
        if self._marks is not None:
            self._marks.clear()
        self._dirty = Bounds(0, 0, info.width, info.height)

    def configure(self, params: ObstacleParams) -> None:
        """Use other parameters; sensor data stays."""
        super().configure(params)
        self._outline = None

    def fit(self, footprint: Footprint) -> None:
        """Use another outline of the robot."""
        self._footprint = footprint

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the rolling window."""
        self._info = info
        self._window.shift(dx, dy)
        if self._marks is not None:
            self._marks.move(dx, dy)
        if self._outline is not None:
            self._outline = self._outline - (dx, dy)
        self._dirty = NOTHING if self._dirty.is_empty else Bounds(0, 0, info.width, info.height)

    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Grow the bounds by what changed."""
        info = self._info
        if info is None:
            return bounds
        changes = _no_changes()
        seen = [(b.params, o) for b in self.buffers.values() for o in b.all()]
        self._clear_and_mark(info, seen, changes)
        if self._marks is not None:
            self._forget(now, info, pose, seen, changes)
        touched, self._dirty = self._dirty.union(self._free_robot(info, pose, changes)), NOTHING
        return bounds.union(touched.union(_area(changes)).clipped(info.width, info.height))

    def _clear_and_mark(self, info: GridInfo, seen: Seen, changes: NDArray[np.int64]) -> None:
        place = info.resolution, info.origin_x, info.origin_y
        cells = self._window.cells
        for source, o in seen:
            if source.clearing and isinstance(o, DepthObservation):
                o.depth.clear(cells, info, self._cleared, changes)
            elif source.clearing:
                reach = max(0, math.ceil(source.raytrace_range / info.resolution - 1e-9))
                kernels.clear_rays(cells, *place, *o.sensor, o.ends, reach, self._cleared, changes)
        for source, o in seen:
            if source.marking and self._is_marked_at(o.height):
                kernels.mark_points(cells, *place, *o.sensor, o.hits, source.obstacle_range, changes)
        kernels.settle(cells, self._cleared, changes)

    def _is_marked_at(self, height: float) -> bool:
        p = self.params
        if isinstance(p, VoxelParams):
            top = p.origin_z + p.z_voxels * p.z_resolution
            if height >= top or p.mark_threshold > 0:  # one scan marks one voxel of a column
                return False
        is_low: bool = height <= p.max_obstacle_height
        return is_low

    def _forget(self, now: float, info: GridInfo, pose: Pose2D, seen: Seen, changes: NDArray[np.int64]) -> None:
        assert self._marks is not None
        for source, o in seen:
            if source.marking and self._is_marked_at(o.height):
                near = ((o.hits - o.sensor) ** 2).sum(axis=1) < source.obstacle_range**2
                at = np.floor((o.hits[near] - (info.origin_x, info.origin_y)) / info.resolution).astype(np.int64)
                at = at[((at >= 0) & (at < (info.width, info.height))).all(axis=1)]
                self._marks.note(now, at[:, 0], at[:, 1])
        old = self._marks.expired(now, self._window.cells, info, seen, pose)
        if len(old):
            self._window.cells[old[:, 1], old[:, 0]] = FREE
            changes[:2] = np.minimum(changes[:2], old.min(axis=0))
            changes[2:4] = np.maximum(changes[2:4], old.max(axis=0) + 1)

    def _free_robot(self, info: GridInfo, pose: Pose2D, changes: NDArray[np.int64]) -> Bounds:
        """Free the robot's own cells in this layer; returns the area to check for them in the master."""
        if not self.params.footprint_clearing_enabled or self._footprint is None:
            return NOTHING
        corners = (transform_points(pose, self._footprint.body) - (info.origin_x, info.origin_y)) / info.resolution
        before, self._outline = self._outline, np.ascontiguousarray(corners)
        kernels.fill_polygon(self._window.cells, self._outline, FREE, 0, 0, info.width, info.height, changes)
        if not self.has_others or (before is not None and np.array_equal(before, corners)):
            return NOTHING
        return _around(corners) if before is None else _around(corners).union(_around(before))

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write this layer's costs."""
        if self._outline is not None and self.has_others:
            kernels.fill_polygon(master, self._outline, FREE, *bounds, _no_changes())
        if self.params.combination_method == 1:
            kernels.merge_max(master, self._window.cells, *bounds)
        elif self.params.combination_method == 0:
            kernels.merge_over(master, self._window.cells, *bounds)

    def reset(self) -> None:
        """Forget sensor data."""
        if self._info is not None:
            self.clear_outside(NOTHING)

    def clear_outside(self, keep: Bounds) -> None:
        """Forget sensor data outside an area."""
        if self._info is None:
            return
        fill_outside(self._window.cells, keep, self._default)
        self._dirty = Bounds(0, 0, self._info.width, self._info.height)

    def clear_inside(self, area: Bounds) -> None:
        """Forget sensor data in an area."""
        if self._info is None:
            return
        area = area.clipped(self._info.width, self._info.height)
        if not area.is_empty:
            self._window.cells[area.y0 : area.y1, area.x0 : area.x1] = self._default
            self._dirty = self._dirty.union(area)

    def is_current(self, now: float) -> bool:
        """Whether the inputs are fresh."""
        return all(buffer.is_current(now) for buffer in self.buffers.values())


def _no_changes() -> NDArray[np.int64]:
    """Initial value of what the kernels update: x0, y0, x1, y1, and a count of cleared cells."""
    return np.array([_LOW, _LOW, _HIGH, _HIGH, 0], np.int64)


def _area(changes: NDArray[np.int64]) -> Bounds:
    return NOTHING if changes[0] >= changes[2] else Bounds(*changes[:4].tolist())


def _around(corners: NDArray[np.float64]) -> Bounds:
    low, high = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
    return Bounds(int(low[0]), int(low[1]), int(high[0]), int(high[1]))
