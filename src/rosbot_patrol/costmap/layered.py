"""A costmap of layers (matches costmap_2d 1.17's LayeredCostmap and the grid side of Costmap2DROS).

Differs: an update of a rolling window also recomputes the strips that came in, so that inflation reaches into them
at once; upstream leaves them free until a beam touches them. Distances of the inflation are exact.
"""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.costmap.bounds import NOTHING, Bounds, merged
from rosbot_patrol.costmap.costs import FREE, UNKNOWN, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.inflation import InflationLayer
from rosbot_patrol.costmap.layer import Layer
from rosbot_patrol.costmap.obstacle import ObstacleLayer, shift_cells
from rosbot_patrol.costmap.params import (
    CostmapConfig,
    InflationParams,
    LayerConfig,
    ObstacleParams,
    StaticParams,
)
from rosbot_patrol.costmap.static import StaticLayer
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo


def make_layer(config: LayerConfig) -> Layer:
    """The layer that a configuration describes."""
    params = config.params
    if isinstance(params, StaticParams):
        return StaticLayer(params, name=config.name)
    if isinstance(params, ObstacleParams):
        return ObstacleLayer(params, config.sources, name=config.name)
    assert isinstance(params, InflationParams)
    return InflationLayer(params, name=config.name)


class LayeredCostmap:
    """Costs around the robot, from layers in the configured order. Not safe between threads: its user locks."""

    def __init__(self, config: CostmapConfig) -> None:
        p = config.params
        self.params = p
        self.name = config.name
        self.layers = [make_layer(layer) for layer in config.layers]
        self.footprint = Footprint.of(
            p.footprint,
            robot_radius=p.robot_radius,
            padding=p.footprint_padding,
            name=f"{config.name}/footprint",
        )
        self._default = UNKNOWN if p.track_unknown_space else FREE
        self._fresh = True
        self.pose = Pose2D()
        size = max(1, math.ceil(p.width / p.resolution - 1e-9)), max(1, math.ceil(p.height / p.resolution - 1e-9))
        self._resize(
            GridInfo(resolution=p.resolution, width=size[0], height=size[1], origin_x=p.origin_x, origin_y=p.origin_y)
        )

    def _resize(self, info: GridInfo) -> None:
        self.info = info
        self.cells: CostCells = np.full(info.shape, self._default, np.uint8)
        for layer in self.layers:
            layer.match(info, self.footprint)
        self._fresh = True

    @property
    def grid(self) -> Grid:
        """Place and costs (the cells are shared, not copied)."""
        return Grid(self.info, self.cells)

    @property
    def static_layers(self) -> list[StaticLayer]:
        """The layers that want a map."""
        return [layer for layer in self.layers if isinstance(layer, StaticLayer)]

    @property
    def obstacle_layers(self) -> list[ObstacleLayer]:
        """The layers that want scans."""
        return [layer for layer in self.layers if isinstance(layer, ObstacleLayer)]

    @property
    def circumscribed_cost(self) -> int:
        """A centre that costs less than this has its whole footprint free; 0 where nothing is inflated."""
        radius = self.footprint.circumscribed_radius
        costs = [layer.cost_at(radius) for layer in self.layers if isinstance(layer, InflationLayer) and layer.enabled]
        is_last = bool(self.layers) and isinstance(self.layers[-1], InflationLayer)
        return max(costs, default=FREE) if is_last else FREE

    def update(self, now: float, pose: Pose2D) -> list[Bounds]:
        """Take in what the layers know, the robot standing at `pose`; returns the areas written."""
        self.pose = pose
        areas = self._follow(pose) if self.params.rolling_window else self._match_map()
        if self._fresh:
            areas, self._fresh = [Bounds(0, 0, self.info.width, self.info.height)], False
        bounds = NOTHING
        for layer in self.layers:
            if layer.enabled:
                bounds = layer.update_bounds(now, pose, bounds)
        reach = max((layer.radius_cells for layer in self.layers if isinstance(layer, InflationLayer)), default=0)
        grown = [bounds, *(area.grown(reach) for area in areas)]
        written = merged([area.clipped(self.info.width, self.info.height) for area in grown])
        for area in written:
            self.cells[area.y0 : area.y1, area.x0 : area.x1] = self._default
        for layer in self.layers:
            if layer.enabled:
                for area in written:
                    layer.update_costs(self.cells, area)
        return written

    def _match_map(self) -> list[Bounds]:
        for layer in self.static_layers:
            if layer.map_info is not None and layer.enabled and layer.map_info != self.info:
                self._resize(layer.map_info)
        return []

    def _follow(self, pose: Pose2D) -> list[Bounds]:
        info = self.info
        width, height = info.size
        dx = int((pose.x - width / 2.0 - info.origin_x) / info.resolution)
        dy = int((pose.y - height / 2.0 - info.origin_y) / info.resolution)
        if dx == 0 and dy == 0:
            return []
        self.info = info.moved_to(info.origin_x + dx * info.resolution, info.origin_y + dy * info.resolution)
        shift_cells(self.cells, dx, dy, self._default)
        for layer in self.layers:
            layer.move(self.info, dx, dy)
        return _strips(info.width, info.height, dx, dy)

    def is_current(self, now: float) -> bool:
        """Whether all inputs are fresh enough to drive by."""
        return all(layer.is_current(now) for layer in self.layers if layer.enabled)

    def reset(self) -> None:
        """Forget what was sensed; the map stays."""
        for layer in self.layers:
            layer.reset()
        self._fresh = True

    def clear_outside(self, pose: Pose2D, side: float) -> None:
        """Forget what was sensed outside a square of `side` [m] around a pose."""
        x0, y0 = self.info.cell_of(pose.x - side / 2.0, pose.y - side / 2.0)
        x1, y1 = self.info.cell_of(pose.x + side / 2.0, pose.y + side / 2.0)
        for layer in self.layers:
            layer.clear_outside(Bounds(x0, y0, x1 + 1, y1 + 1))
        self._fresh = True


def _strips(width: int, height: int, dx: int, dy: int) -> list[Bounds]:
    """The cells that come into a window that moved by (dx, dy)."""
    strips = []
    if dx:
        strips.append(Bounds(width - dx, 0, width, height) if dx > 0 else Bounds(0, 0, -dx, height))
    if dy:
        strips.append(Bounds(0, height - dy, width, height) if dy > 0 else Bounds(0, 0, width, -dy))
    return [strip.clipped(width, height) for strip in strips]
