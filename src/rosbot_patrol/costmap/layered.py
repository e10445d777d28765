"""A costmap of layers (matches costmap_2d 1.17's LayeredCostmap and the grid side of Costmap2DROS).

An update computes only cells that can have changed: those that a layer reports, those within the inflation's reach of
them, and those that entered a rolling window. Cell for cell the result equals that of computing the whole window. The
window slides over its memory, so that moving it copies nothing.

Differs: cells that enter a rolling window are inflated at once, and the inflation of obstacles that have left it is
removed; upstream leaves both until a beam touches the cells. Distances of the inflation are exact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rosbot_patrol.costmap.bounds import NOTHING, Bounds, merged
from rosbot_patrol.costmap.costs import FREE, LETHAL, UNKNOWN, CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layers.inflation import InflationLayer
from rosbot_patrol.costmap.layers.keepout import KeepoutLayer
from rosbot_patrol.costmap.layers.layer import Layer
from rosbot_patrol.costmap.layers.obstacle import ObstacleLayer
from rosbot_patrol.costmap.layers.range_layer import RangeSensorLayer
from rosbot_patrol.costmap.layers.static import StaticLayer
from rosbot_patrol.costmap.params import (
    CostmapConfig,
    CostmapParams,
    InflationParams,
    KeepoutParams,
    LayerConfig,
    ObstacleParams,
    StaticParams,
)
from rosbot_patrol.costmap.scrolling import ScrollingCells, strips
from rosbot_patrol.costmap.sensor_params import RangeSensorParams
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo


def _footprint(p: CostmapParams, name: str) -> Footprint:
    return Footprint.of(p.footprint, robot_radius=p.robot_radius, padding=p.footprint_padding, name=f"{name}/footprint")


def _info(p: CostmapParams) -> GridInfo:
    # as upstream's cast to a whole number, but for what a division leaves below one
    size = max(1, int(p.width / p.resolution + 1e-9)), max(1, int(p.height / p.resolution + 1e-9))
    return GridInfo(resolution=p.resolution, width=size[0], height=size[1], origin_x=p.origin_x, origin_y=p.origin_y)


def make_layer(config: LayerConfig) -> Layer:
    """Make the layer that a configuration describes."""
    params = config.params
    if isinstance(params, KeepoutParams):
        return KeepoutLayer(params, name=config.name)
    if isinstance(params, StaticParams):
        return StaticLayer(params, name=config.name)
    if isinstance(params, ObstacleParams):
        return ObstacleLayer(params, config.sources, name=config.name)
    if isinstance(params, RangeSensorParams):
        return RangeSensorLayer(params, name=config.name)
    assert isinstance(params, InflationParams)
    return InflationLayer(params, name=config.name)


class LayeredCostmap:
    """Costs around the robot, from layers in the configured order. Not thread-safe: its user locks."""

    def __init__(self, config: CostmapConfig) -> None:
        p = config.params
        self.params = p
        self.name = config.name
        self.layers = [make_layer(layer) for layer in config.layers]
        self.footprint = _footprint(p, config.name)
        self._default = UNKNOWN if p.track_unknown_space else FREE
        self._arrange()
        self._fresh = True
        self._enabled: list[bool] = []
        self.pose = Pose2D()
        self._resize(_info(p))

    def add(self, layer: Layer) -> None:
        """Add a layer before the inflation, or as the last one."""
        at = next((i for i, each in enumerate(self.layers) if isinstance(each, InflationLayer)), len(self.layers))
        self.layers.insert(at, layer)
        layer.match(self.info, self.footprint)
        self._arrange()
        self._fresh = True

    def configure(self, params: CostmapParams) -> None:
        """Use other parameters; a change of size, place or resolution forgets sensor data but keeps maps.

        Raises:
            ParamError: the footprint is none.
        """
        self.footprint = _footprint(params, self.name)
        before, self.params = self.params, params
        if _info(before) != _info(params):
            self._resize(_info(params))
        for layer in self.layers:
            layer.fit(self.footprint)
        self._fresh = True

    def configure_layer(self, layer: Layer, params: StaticParams | ObstacleParams | InflationParams) -> None:
        """Use other parameters for one of the layers."""
        layer.configure(params)
        self._fresh = True

    def _arrange(self) -> None:
        """Tell the layers about each other."""
        for i, layer in enumerate(self.layers):
            others = [o for o in self.layers if o is not layer and not isinstance(o, InflationLayer)]
            if isinstance(layer, InflationLayer):
                layer.keeps_source = any(not isinstance(o, InflationLayer) for o in self.layers[i + 1 :])
            elif isinstance(layer, ObstacleLayer):
                layer.has_others = bool(others)

    def _resize(self, info: GridInfo) -> None:
        self.info = info
        moves = self.params.rolling_window
        self._window = ScrollingCells(info.height, info.width, self._default, moves=moves)
        for layer in self.layers:
            layer.match(info, self.footprint)
        self._fresh = True

    @property
    def cells(self) -> CostCells:
        """Costs now, shape (height, width); stale after the next update of a rolling window."""
        return self._window.cells

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
    def range_layers(self) -> list[RangeSensorLayer]:
        """The layers that want readings of range sensors."""
        return [layer for layer in self.layers if isinstance(layer, RangeSensorLayer)]

    @property
    def circumscribed_cost(self) -> int:
        """Cost below which the whole footprint around a cell is free; 0 without an inflation layer."""
        radius = self.footprint.circumscribed_radius
        costs = [layer.cost_at(radius) for layer in self.layers if isinstance(layer, InflationLayer) and layer.enabled]
        is_last = bool(self.layers) and isinstance(self.layers[-1], InflationLayer)
        return max(costs, default=FREE) if is_last else FREE

    def update(self, now: float, pose: Pose2D) -> list[Bounds]:
        """Update from all layers with the robot at `pose`; returns the areas written, without overlap."""
        self.pose = pose
        areas = self._follow(pose) if self.params.rolling_window else self._match_map()
        enabled = [layer.enabled for layer in self.layers]
        self._fresh |= enabled != self._enabled
        self._enabled = enabled
        bounds = NOTHING
        for layer in self.layers:
            if layer.enabled:
                bounds = layer.update_bounds(now, pose, bounds)
        width, height = self.info.width, self.info.height
        if self._fresh:
            areas, bounds, self._fresh = [], Bounds(0, 0, width, height), False
        written = merged([area.clipped(width, height) for area in (bounds, *areas)])
        for area in written:
            self.cells[area.y0 : area.y1, area.x0 : area.x1] = self._default
        for layer in self.layers:
            if layer.enabled:
                if isinstance(layer, InflationLayer):
                    layer.take_sources(self.cells, written)
                for area in written:
                    layer.update_costs(self.cells, area)
        return written

    @property
    def _reach(self) -> int:
        return max((layer.reach for layer in self.layers if isinstance(layer, InflationLayer)), default=0)

    def _match_map(self) -> list[Bounds]:
        for layer in self.static_layers:
            if layer.sets_size and layer.map_info is not None and layer.enabled and layer.map_info != self.info:
                self._resize(layer.map_info)
        return []

    def _follow(self, pose: Pose2D) -> list[Bounds]:
        """Move the window to the robot; returns the areas to compute again."""
        info = self.info
        # upstream's size ends at the centre of the last cell (Costmap2D::getSizeInMetersX)
        width, height = (info.width - 0.5) * info.resolution, (info.height - 0.5) * info.resolution
        dx = int((pose.x - width / 2.0 - info.origin_x) / info.resolution)
        dy = int((pose.y - height / 2.0 - info.origin_y) / info.resolution)
        if dx == 0 and dy == 0:
            return []
        self.info = info.moved_to(info.origin_x + dx * info.resolution, info.origin_y + dy * info.resolution)
        left = self._lethal_leaving(dx, dy)
        self._window.shift(dx, dy)
        for layer in self.layers:
            layer.move(self.info, dx, dy)
        brings = any(isinstance(layer, StaticLayer) and layer.enabled for layer in self.layers)
        came = [area.grown(self._reach if brings else 0) for area in strips(info.width, info.height, dx, dy)]
        return [*came, *(area.grown(self._reach) for area in left)]

    def _lethal_leaving(self, dx: int, dy: int) -> list[Bounds]:
        """Places outside the moved window of lethal cells that have been inflated."""
        found = []
        inflated = [layer.sources(self.cells) for layer in self.layers if isinstance(layer, InflationLayer)]
        for strip in strips(self.info.width, self.info.height, -dx, -dy):
            for cells in inflated:
                ys, xs = np.nonzero(cells[strip.y0 : strip.y1, strip.x0 : strip.x1] == LETHAL)
                if len(ys):
                    x, y = strip.x0 - dx, strip.y0 - dy
                    low, high = (x + int(xs.min()), y + int(ys.min())), (x + int(xs.max()) + 1, y + int(ys.max()) + 1)
                    found.append(Bounds(*low, *high))
        return found

    def is_current(self, now: float) -> bool:
        """Whether all inputs are fresh enough to drive by."""
        return all(layer.is_current(now) for layer in self.layers if layer.enabled)

    def reset(self) -> None:
        """Forget sensor data; the map stays."""
        for layer in self.layers:
            layer.reset()
        self._fresh = True

    def clear_outside(self, pose: Pose2D, side: float) -> None:
        """Forget sensor data outside a square of `side` [m] around a pose."""
        self.clear_square(pose, side)

    def clear_square(
        self, pose: Pose2D, side: float, *, inside: bool = False, names: Sequence[str] | None = None
    ) -> list[str]:
        """Forget sensor data outside or inside a square around a pose.

        Args:
            pose: its middle.
            side: its extent [m].
            inside: clear the inside instead of the outside.
            names: of the layers to clear; None: all.

        Returns:
            Those of the names that no layer has.
        """
        x0, y0 = self.info.cell_of(pose.x - side / 2.0, pose.y - side / 2.0)
        x1, y1 = self.info.cell_of(pose.x + side / 2.0, pose.y + side / 2.0)
        square = Bounds(x0, y0, x1 + 1, y1 + 1)
        for layer in self.layers:
            if names is None or layer.name in names:
                (layer.clear_inside if inside else layer.clear_outside)(square)
        self._fresh = True
        own = {layer.name for layer in self.layers}
        return [name for name in names or () if name not in own]

    def update_now(self, now: float) -> None:
        """Apply what was cleared at once; the next update computes and returns everything again."""
        self.update(now, self.pose)
        self._fresh = True
