"""Keepout layer: places where the robot must not go, although nothing stands there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import FREE, UNKNOWN, CostCells
from rosbot_patrol.costmap.layers.static import StaticLayer
from rosbot_patrol.costmap.params import KeepoutParams


class KeepoutLayer(StaticLayer):
    """A mask over the costmap (after nav2's KeepoutFilter): occupied cells become lethal, all others stay.

    The mask is an occupancy grid in any place, resolution and frame. Cells of at least `lethal_cost_threshold` are
    lethal; lower ones become costs if `trinary_costmap` is false; unknown ones are ignored. Costs combine by maximum,
    and the mask never sets the costmap's size. Put the layer before the inflation layer, so that plans keep their
    distance. The costmap is not current until the mask has arrived: a robot that does not know its forbidden places
    does not start. Files are read at the edges: the node passes `set_map` the contents of `mask_file`, if it is set,
    else the messages on `map_topic`.
    """

    sets_size = False

    def __init__(self, params: KeepoutParams, *, name: str = "keepout_layer") -> None:
        super().__init__(params, name=name)
        self.mask_file, self.mask_frame = params.mask_file, params.mask_frame

    def _translate(self, occupancy: NDArray[np.int8]) -> CostCells:
        costs = super()._translate(occupancy)
        costs[costs == FREE] = UNKNOWN  # says nothing
        costs[occupancy < 0] = UNKNOWN
        return costs

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Raise the costs to the mask's costs."""
        if self.map_info is None or self._info is None:
            return
        if self._is_aligned:
            kernels.merge_max(master, self._costs, *bounds)
        else:
            self._sample(master, bounds, use_maximum=True)
