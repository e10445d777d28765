"""Zones layer: the keep-out zones that a guard's owner has drawn; without zones it costs nothing."""

from __future__ import annotations

from rosbot_patrol.costmap.layers.keepout import KeepoutLayer
from rosbot_patrol.costmap.params import KeepoutParams
from rosbot_patrol.maps.zones import Zone, zones_grid


class ZonesLayer(KeepoutLayer):
    """A keep-out layer with polygons in map as its mask; a robot without any need not wait for it."""

    def __init__(self) -> None:
        super().__init__(KeepoutParams(), name="zones")

    def set_zones(self, zones: tuple[Zone, ...]) -> None:
        """Use other zones."""
        if zones or self.map_info is not None:
            self.set_map(zones_grid(zones))

    def is_current(self, now: float) -> bool:
        """Always: what there is was read before."""
        del now
        return True
