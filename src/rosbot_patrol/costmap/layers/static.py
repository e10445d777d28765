"""Static layer: a given map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import NOTHING, Bounds
from rosbot_patrol.costmap.costs import CostCells, costs_of_occupancy
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layers.layer import Layer
from rosbot_patrol.costmap.params import StaticParams
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, invert
from rosbot_patrol.grid import Grid, GridInfo


class StaticLayer(Layer):
    """Matches costmap_2d::StaticLayer: an occupancy grid, whole or as updates, becomes costs.

    A costmap that does not roll adopts the map's place and size. In a rolling costmap, or one in another frame, the map
    is sampled at the master's cells through `master_from_map`.
    """

    sets_size = True  # whether a costmap that does not roll takes the map's place

    def __init__(self, params: StaticParams, *, name: str = "static_layer") -> None:
        self.name = name
        self.enabled = params.enabled
        self.params = params
        self.map_info: GridInfo | None = None
        self.master_from_map = Pose2D()
        self._costs: CostCells = np.zeros((1, 1), np.uint8)
        self._info: GridInfo | None = None
        self._changed: Bounds | None = None
        self._sampled_from: Pose2D | None = None

    def set_map(self, grid: Grid) -> None:
        """Use a new map; ignored after the first with `first_map_only`."""
        if self.params.first_map_only and self.map_info is not None:
            return
        grid.info.require_aligned(self.name)
        if grid.info.width < 1 or grid.info.height < 1 or grid.info.resolution <= 0.0:
            raise MapError(self.name, f"a map of {grid.info.width} x {grid.info.height} cells is no map")
        before, self._costs = self._costs, self._translate(grid.cells)
        whole = Bounds(0, 0, grid.info.width, grid.info.height)
        changed = _difference(before, self._costs) if self.map_info == grid.info else whole
        self._changed = changed.union(self._changed or NOTHING)
        self.map_info = grid.info

    def update_map(self, x: int, y: int, cells: NDArray[np.int8]) -> None:
        """Use new occupancy values for a rectangle of the map; cells outside the map are ignored."""
        if self.map_info is None:
            return
        height, width = cells.shape
        part = Bounds(x, y, x + width, y + height).clipped(self.map_info.width, self.map_info.height)
        if part.is_empty:
            return
        inner = cells[part.y0 - y : part.y1 - y, part.x0 - x : part.x1 - x]
        self._costs[part.y0 : part.y1, part.x0 : part.x1] = self._translate(inner)
        self._changed = part.union(self._changed or NOTHING)

    def _translate(self, occupancy: NDArray[np.int8]) -> CostCells:
        p = self.params
        costs = costs_of_occupancy(
            occupancy,
            lethal_threshold=p.lethal_cost_threshold,
            unknown_value=p.unknown_cost_value,
            track_unknown=p.track_unknown_space,
            trinary=p.trinary_costmap,
        )
        return np.ascontiguousarray(costs)

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Adopt the master's place and size."""
        self._info = info
        if self.map_info is not None:
            self._changed = Bounds(0, 0, self.map_info.width, self.map_info.height)

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the rolling window."""
        self._info = info

    @property
    def _is_aligned(self) -> bool:
        return self._info == self.map_info and self.master_from_map == Pose2D()

    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Grow the bounds by what changed."""
        if self._changed is None or self._info is None or self.map_info is None:
            if self.map_info is not None and self._sampled_from not in (None, self.master_from_map):
                return self._whole(bounds)  # the map moved against the master
            return bounds
        changed, self._changed = self._changed, None
        if changed.is_empty:
            return bounds
        if self._is_aligned:
            return bounds.union(changed)
        return self._whole(bounds)

    def _whole(self, bounds: Bounds) -> Bounds:
        assert self._info is not None
        return bounds.union(Bounds(0, 0, self._info.width, self._info.height))

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write this layer's costs."""
        if self.map_info is None or self._info is None:
            return
        if self._is_aligned:
            if self.params.use_maximum:
                kernels.merge_max(master, self._costs, *bounds)
            else:
                area = np.s_[bounds.y0 : bounds.y1, bounds.x0 : bounds.x1]
                master[area] = self._costs[area]
            return
        self._sample(master, bounds, use_maximum=self.params.use_maximum)

    def _sample(self, master: CostCells, bounds: Bounds, *, use_maximum: bool) -> None:
        """Write the map's costs at the master's cells."""
        assert self._info is not None
        assert self.map_info is not None
        self._sampled_from = self.master_from_map
        kernels.sample_map(master, self._costs, *bounds, self._affine(self._info, self.map_info), use_maximum)

    def _affine(self, info: GridInfo, source: GridInfo) -> NDArray[np.float64]:
        """Transform from cells of the master to cells of the map, as `sample_map` expects it."""
        back = invert(self.master_from_map)
        c, s = math.cos(back.yaw), math.sin(back.yaw)
        ratio = info.resolution / source.resolution
        x, y = info.centre_of(0, 0)
        x0 = (back.x + c * x - s * y - source.origin_x) / source.resolution
        y0 = (back.y + s * x + c * y - source.origin_y) / source.resolution
        return np.array([c * ratio, -s * ratio, x0, s * ratio, c * ratio, y0])

    def is_current(self, now: float) -> bool:
        """Whether there is a map."""
        return self.map_info is not None or not self.enabled


def _difference(before: CostCells, after: CostCells) -> Bounds:
    """Rectangle around the cells that differ between two grids of the same shape."""
    differs = before != after
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    if not len(rows):
        return NOTHING
    return Bounds(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
