"""The inflation layer: costs that fall with the distance from lethal cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import FREE, INSCRIBED, LETHAL, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layers import inflation_kernels as kernels
from rosbot_patrol.costmap.layers.layer import Layer
from rosbot_patrol.costmap.params import InflationParams
from rosbot_patrol.costmap.scrolling import ScrollingCells
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import GridInfo


def cost_at(distance: float, *, inscribed_radius: float, cost_scaling_factor: float) -> int:
    """Cost at a distance [m] from the nearest lethal cell, as costmap_2d documents it."""
    if distance == 0.0:
        return LETHAL
    if distance <= inscribed_radius:
        return INSCRIBED
    return int((INSCRIBED - 1) * math.exp(-cost_scaling_factor * (distance - inscribed_radius)))


def cost_table(
    radius_cells: int, resolution: float, *, inscribed_radius: float, cost_scaling_factor: float
) -> NDArray[np.uint8]:
    """`cost_at` for each squared distance in cells, 0 to radius_cells squared."""
    metres = np.sqrt(np.arange(radius_cells * radius_cells + 1)) * resolution
    decayed = (INSCRIBED - 1) * np.exp(-cost_scaling_factor * np.maximum(metres - inscribed_radius, 0.0))
    table: NDArray[np.uint8] = decayed.astype(np.uint8)
    table[metres <= inscribed_radius] = INSCRIBED
    table[0] = LETHAL
    return table


class InflationLayer(Layer):
    """Matches costmap_2d::InflationLayer.

    Differs: distances are exact; upstream passes sources from cell to cell and sometimes overestimates by less than a
    cell. Cells that would cost 0 are not visited, so a radius beyond the decay of `cost_scaling_factor` costs no time.
    Only lethal cells of earlier layers are inflated, also after a partial update by a later layer.
    """

    def __init__(self, params: InflationParams, *, name: str = "inflation_layer") -> None:
        self.name = name
        self.enabled = params.enabled
        self.params = params
        self.keeps_source = False
        self._source: ScrollingCells | None = None
        self._info: GridInfo | None = None
        self._reach = 0
        self._table = np.array([LETHAL], np.uint8)
        self._inscribed = 0.0
        self._is_new = True

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Adopt the master's place and size."""
        self._info = info
        self._inscribed = footprint.inscribed_radius
        self._source = ScrollingCells(info.height, info.width, FREE) if self.keeps_source else None
        self._set_table()

    def configure(self, params: InflationParams) -> None:
        """Use other parameters; the next update inflates again."""
        self.params, self.enabled = params, params.enabled
        if self._info is not None:
            self._set_table()

    def fit(self, footprint: Footprint) -> None:
        """Use another outline of the robot."""
        self._inscribed = footprint.inscribed_radius
        if self._info is not None:
            self._set_table()

    def _set_table(self) -> None:
        assert self._info is not None
        radius = max(0, math.ceil(self.params.inflation_radius / self._info.resolution - 1e-9))
        table = cost_table(
            radius,
            self._info.resolution,
            inscribed_radius=self._inscribed,
            cost_scaling_factor=self.params.cost_scaling_factor,
        )
        self._reach = math.ceil(math.sqrt(int(np.flatnonzero(table)[-1])))
        size = 65536 if self._reach <= kernels.NEAR else self._reach**2 + 1
        self._table = np.zeros(size, np.uint8)
        self._table[: min(size, len(table))] = table[:size]
        self._is_new = True

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the rolling window."""
        self._info = info
        if self._source is not None:
            self._source.shift(dx, dy)

    def cost_at(self, distance: float) -> int:
        """Cost at a distance [m]; free beyond the inflation radius."""
        if distance > self.params.inflation_radius:
            return FREE
        factor = self.params.cost_scaling_factor
        return cost_at(distance, inscribed_radius=self._inscribed, cost_scaling_factor=factor)

    @property
    def reach(self) -> int:
        """Distance up to which a lethal cell raises costs [cells]."""
        return self._reach if self.enabled else 0

    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Grow the bounds by what changed."""
        if self._is_new and self._info is not None:
            self._is_new = False
            return Bounds(0, 0, self._info.width, self._info.height)
        return bounds.grown(self._reach)

    def sources(self, master: CostCells) -> CostCells:
        """Grid with the lethal cells that this layer inflates."""
        return master if self._source is None else self._source.cells

    def take_sources(self, master: CostCells, areas: list[Bounds]) -> None:
        """Copy the costs of the earlier layers before a later layer writes over them."""
        if self._source is not None:
            for area in areas:
                at = np.s_[area.y0 : area.y1, area.x0 : area.x1]
                self._source.cells[at] = master[at]

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write this layer's costs."""
        if self._reach == 0:
            return
        source = self.sources(master)
        floor = 1 if self.params.inflate_unknown else INSCRIBED
        run = kernels.inflate if self._reach <= kernels.NEAR else kernels.inflate_far
        run(source, master, *bounds, self._reach, self._table, floor)
