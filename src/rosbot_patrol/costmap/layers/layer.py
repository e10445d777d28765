"""What a layer of a costmap is."""

# ruff: noqa: B027 - a layer overrides only the hooks that it needs
from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import CostCells
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import GridInfo


class Layer(ABC):
    """One source of costs; the layered costmap calls the layers in the order in which they are configured.

    An update has two halves, as upstream: `update_bounds` says which cells may change, then `update_costs` writes
    this layer's costs over those cells of the master, which hold what the layers before wrote.
    """

    name: str = ""
    enabled: bool = True
    params: Any = None

    def configure(self, params: Any) -> None:
        """Take other parameters of the same class; the costmap is then computed anew."""
        self.params, self.enabled = params, params.enabled

    def fit(self, footprint: Footprint) -> None:
        """Take another outline of the robot, keeping what is known and sensed."""

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Take the master's place and size, forgetting everything that depends on it."""

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """The master moved by (dx, dy) cells: content shifts by (-dx, -dy)."""

    @abstractmethod
    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """`bounds`, grown by the cells that this layer changes."""

    @abstractmethod
    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write costs into `master` over `bounds`."""

    def reset(self) -> None:
        """Forget what was sensed (not what is known, such as the map)."""

    def clear_outside(self, keep: Bounds) -> None:
        """Forget what was sensed outside `keep`."""

    def clear_inside(self, area: Bounds) -> None:
        """Forget what was sensed in `area`."""

    def is_current(self, now: float) -> bool:
        """Whether the layer's inputs are as fresh as its parameters demand."""
        del now
        return True
