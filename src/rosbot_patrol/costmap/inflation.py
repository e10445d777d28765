"""The inflation layer: costs that fall with the distance from lethal cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import FREE, INSCRIBED, LETHAL, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layer import Layer
from rosbot_patrol.costmap.params import InflationParams
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
    table = decayed.astype(np.uint8)
    table[metres <= inscribed_radius] = INSCRIBED
    table[0] = LETHAL
    return table


class InflationLayer(Layer):
    """Matches costmap_2d::InflationLayer; distances are exact."""

    def __init__(self, params: InflationParams, *, name: str = "inflation_layer") -> None:
        self.name = name
        self.enabled = params.enabled
        self.params = params
        self._info: GridInfo | None = None
        self._radius = 0
        self._table = np.array([LETHAL], np.uint8)
        self._inscribed = 0.0

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Take the master's place and size."""
        self._info = info
        self._inscribed = footprint.inscribed_radius
        self._radius = max(0, math.ceil(self.params.inflation_radius / info.resolution - 1e-9))
        self._table = cost_table(
            self._radius,
            info.resolution,
            inscribed_radius=self._inscribed,
            cost_scaling_factor=self.params.cost_scaling_factor,
        )

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the rolling window."""
        self._info = info

    def cost_at(self, distance: float) -> int:
        """Cost at a distance [m]; free beyond the inflation radius."""
        if distance > self.params.inflation_radius:
            return FREE
        factor = self.params.cost_scaling_factor
        return cost_at(distance, inscribed_radius=self._inscribed, cost_scaling_factor=factor)

    @property
    def radius_cells(self) -> int:
        """How far a lethal cell reaches."""
        return self._radius if self.enabled else 0

    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Grow the bounds by what changed."""
        return bounds.grown(self._radius)

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write this layer's costs."""
        if self._radius > 0:
            kernels.inflate(master, *bounds, self._radius, self._table, self.params.inflate_unknown)
