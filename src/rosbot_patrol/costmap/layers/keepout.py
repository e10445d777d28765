"""A layer of places where the robot must not go, although nothing stands there."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import FREE, UNKNOWN, CostCells
from rosbot_patrol.costmap.layers.static import StaticLayer
from rosbot_patrol.costmap.params import KeepoutParams


class KeepoutLayer(StaticLayer):
    """A mask over the costmap (the idea is nav2's KeepoutFilter): occupied cells become lethal, all others stay.

    The mask is a grid like a map, in any place, resolution and frame. Cells from `lethal_cost_threshold` on are lethal;
    those below become costs where `trinary_costmap` is false, unknown ones say nothing. Costs combine by maximum and
    the mask never gives the costmap its size. Put it before the inflation layer, so that the way keeps its distance.
    As with a map, the costmap is not current until the mask has come: a robot that does not know yet where it must
    not go does not start. Files are read at the edges: the node gives `set_map` what `mask_file` holds, if that is
    set, else what comes on `map_topic`.
    """

    sets_size = False

    def __init__(self, params: KeepoutParams, *, name: str = "keepout_layer") -> None:
        super().__init__(params, name=name)
        self.mask_file, self.mask_frame = params.mask_file, params.mask_frame

    def _translate(self, occupancy: np.ndarray) -> CostCells:
        costs = super()._translate(occupancy)
        costs[costs == FREE] = UNKNOWN  # says nothing
        costs[occupancy < 0] = UNKNOWN
        return costs

    def update_costs(self, master: CostCells, bounds: Bounds) -> None:
        """Raise the costs to the mask's."""
        if self.map_info is None or self._info is None:
            return
        if self._is_aligned:
            kernels.merge_max(master, self._costs, *bounds)
        else:
            self._sample(master, bounds, use_maximum=True)
