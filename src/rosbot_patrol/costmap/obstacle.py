"""The obstacle layer: what the lidar sees now, and what it saw where it does not look now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import NOTHING, Bounds
from rosbot_patrol.costmap.costs import FREE, UNKNOWN, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layer import Layer
from rosbot_patrol.costmap.params import ObstacleParams, SourceParams
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Observation:
    """A scan in the costmap's frame.

    Attributes:
        stamp: when it was measured [s].
        sensor: where from, (x, y) [m].
        hits: what was hit, shape (N, 2).
        ends: up to where the way is free, shape (M, 2).
        height: of the points above the ground [m].
    """

    stamp: float
    sensor: tuple[float, float]
    hits: Array
    ends: Array
    height: float = 0.1


def observe(scan: LaserScan, pose: Pose2D, *, inf_is_valid: bool = False, height: float = 0.1) -> Observation:
    """A scan taken at `pose` (of the sensor, in the costmap's frame; no flip) as an observation.

    Beams outside the scan's own limits say nothing; with `inf_is_valid` a beam that hit nothing clears up to the
    range's end.
    """
    angles = scan.angles
    units = np.column_stack((np.cos(angles), np.sin(angles)))
    hit = scan.is_hit
    hits = transform_points(pose, units[hit] * scan.ranges[hit, None])
    ends = hits
    if inf_is_valid:
        open_beams = np.isposinf(scan.ranges)
        far = transform_points(pose, units[open_beams] * (scan.range_max - 1e-4))
        ends = np.concatenate((hits, far))
    return Observation(
        stamp=scan.stamp,
        sensor=(pose.x, pose.y),
        hits=np.ascontiguousarray(hits),
        ends=np.ascontiguousarray(ends),
        height=height,
    )


class ObservationBuffer:
    """The observations of one source that are still to be used."""

    def __init__(self, params: SourceParams) -> None:
        self.params = params
        self._kept: list[Observation] = []
        self._last = float("-inf")

    def add(self, observation: Observation) -> None:
        """Store one; older ones go as `observation_persistence` says."""
        if observation.stamp < self._last - 1.0:  # time went back
            self._kept.clear()
        self._last = observation.stamp
        self._kept.append(observation)
        oldest = observation.stamp - self.params.observation_persistence
        self._kept = [o for o in self._kept if o.stamp >= oldest]
        if self.params.observation_persistence == 0.0:
            self._kept = self._kept[-1:]

    def all(self) -> list[Observation]:
        """What an update uses, oldest first."""
        return list(self._kept)

    def clear(self) -> None:
        """Forget all, so that what was cleared does not come back from an old scan."""
        self._kept.clear()

    def is_current(self, now: float) -> bool:
        """Whether input is as fresh as `expected_update_rate` demands."""
        limit = self.params.expected_update_rate
        return limit == 0.0 or now - self._last <= limit


class ObstacleLayer(Layer):
    """Matches costmap_2d::ObstacleLayer for laser scans: rays clear, hits mark, the robot's own cells are free.

    Differs: only the robot itself is cleared, without its padding; upstream clears the padding too, so that a slow
    robot eats its way into an obstacle.
    """

    def __init__(
        self, params: ObstacleParams, sources: dict[str, SourceParams], *, name: str = "obstacle_layer"
    ) -> None:
        self.name = name
        self.enabled = params.enabled
        self.params = params
        self.buffers = {key: ObservationBuffer(source) for key, source in sources.items()}
        self._default = UNKNOWN if params.track_unknown_space else FREE
        self._cells: CostCells = np.zeros((1, 1), np.uint8)
        self._info: GridInfo | None = None
        self._footprint: Footprint | None = None
        self._dirty = NOTHING
        self._outline: Array | None = None

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Take the master's place and size."""
        self._info, self._footprint = info, footprint
        self._cells = np.full(info.shape, self._default, np.uint8)
        self._dirty = Bounds(0, 0, info.width, info.height)

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the rolling window."""
        self._info = info
        shift_cells(self._cells, dx, dy, self._default)
        self._dirty = NOTHING if self._dirty.is_empty else Bounds(0, 0, info.width, info.height)

    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Grow the bounds by what changed."""
        info = self._info
        if info is None:
            return bounds
        touched, self._dirty = self._dirty, NOTHING
        place = (info.resolution, info.origin_x, info.origin_y)
        kept = [(b.params, o) for b in self.buffers.values() for o in b.all()]
        for source, seen in kept:
            if source.clearing and len(seen.ends):
                area = kernels.clear_rays(self._cells, *place, *seen.sensor, seen.ends, source.raytrace_range)
                touched = touched.union(Bounds(*area.tolist()))
        for source, seen in kept:
            lowest, highest = source.min_obstacle_height, source.max_obstacle_height
            if source.marking and lowest <= seen.height <= min(highest, self.params.max_obstacle_height):
                area = kernels.mark_points(self._cells, *place, *seen.sensor, seen.hits, source.obstacle_range)
                touched = touched.union(Bounds(*area.tolist()))
        touched = touched.union(self._clear_footprint(info, pose))
        return bounds.union(touched.clipped(info.width, info.height))

    def _clear_footprint(self, info: GridInfo, pose: Pose2D) -> Bounds:
        if not self.params.footprint_clearing_enabled or self._footprint is None:
            return NOTHING
        corners = (transform_points(pose, self._footprint.body) - (info.origin_x, info.origin_y)) / info.resolution
        self._outline = np.ascontiguousarray(corners)
        kernels.fill_polygon(self._cells, self._outline, FREE)
        low, high = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
        return Bounds(int(low[0]), int(low[1]), int(high[0]), int(high[1]))

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write this layer's costs."""
        if self._outline is not None:
            kernels.fill_polygon(master, self._outline, FREE)
        if self.params.combination_method == 1:
            kernels.merge_max(master, self._cells, *bounds)
        elif self.params.combination_method == 0:
            kernels.merge_over(master, self._cells, *bounds)

    def reset(self) -> None:
        """Forget what was sensed."""
        if self._info is not None:
            self.clear_outside(NOTHING)

    def clear_outside(self, keep: Bounds) -> None:
        """Forget what was sensed outside an area."""
        if self._info is None:
            return
        keep = keep.clipped(self._info.width, self._info.height)
        inner = np.s_[keep.y0 : keep.y1, keep.x0 : keep.x1]
        kept = None if keep.is_empty else self._cells[inner].copy()
        self._cells.fill(self._default)
        if kept is not None:
            self._cells[inner] = kept
        self._dirty = Bounds(0, 0, self._info.width, self._info.height)

    def is_current(self, now: float) -> bool:
        """Whether the inputs are fresh."""
        return all(buffer.is_current(now) for buffer in self.buffers.values())


def shift_cells(cells: CostCells, dx: int, dy: int, default: int) -> None:
    """Move the content by (-dx, -dy) cells in place; what comes in is `default`."""
    height, width = cells.shape
    if abs(dx) >= width or abs(dy) >= height:
        cells.fill(default)
        return
    into = np.s_[max(-dy, 0) : height - max(dy, 0), max(-dx, 0) : width - max(dx, 0)]
    out_of = np.s_[max(dy, 0) : height - max(-dy, 0), max(dx, 0) : width - max(-dx, 0)]
    kept = cells[out_of].copy()
    if dy > 0:
        cells[height - dy :] = default
    elif dy < 0:
        cells[:-dy] = default
    if dx > 0:
        cells[:, width - dx :] = default
    elif dx < 0:
        cells[:, :-dx] = default
    cells[into] = kept
