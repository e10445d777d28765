"""Interface of a costmap layer."""

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
    """One source of costs; the layered costmap calls its layers in the configured order.

    As upstream, an update has two halves: `update_bounds` reports the cells that may change, then `update_costs` writes
    this layer's costs over those cells of the master. The master holds the costs of the earlier layers by then.
    """

    name: str = ""
    enabled: bool = True
    params: Any = None

    def configure(self, params: Any) -> None:
        """Use other parameters of the same class; the costmap is then computed again."""
        self.params, self.enabled = params, params.enabled

    def fit(self, footprint: Footprint) -> None:
        """Use another outline of the robot; maps and sensor data stay."""

    def match(self, info: GridInfo, footprint: Footprint) -> None:
        """Adopt the master's place and size, and forget everything that depends on it."""

    def move(self, info: GridInfo, dx: int, dy: int) -> None:
        """Follow the master, which moved by (dx, dy) cells: the content shifts by (-dx, -dy)."""

    @abstractmethod
    def update_bounds(self, now: float, pose: Pose2D, bounds: Bounds) -> Bounds:
        """Return `bounds`, grown by the cells that this layer changes."""

    @abstractmethod
    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Write costs into `master` over `bounds`."""

    def reset(self) -> None:
        """Forget sensor data, but not maps."""

    def clear_outside(self, keep: Bounds) -> None:
        """Forget sensor data outside `keep`."""

    def clear_inside(self, area: Bounds) -> None:
        """Forget sensor data in `area`."""

    def is_current(self, now: float) -> bool:
        """Whether the layer's inputs are as fresh as its parameters demand."""
        del now
        return True
