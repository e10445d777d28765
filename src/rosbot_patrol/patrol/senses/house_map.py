"""House map: the floor of the map, divided among the rooms."""

from __future__ import annotations

import logging

from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.zones import Zone
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.regions import RoomRegions, part_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.senses.health import ERROR, OK, WARN, Health

log = logging.getLogger(__name__)


class HouseMap:
    """Keeps the rooms of the newest good map. `hear` takes seconds for a large one: a node has a thread for it.

    Args:
        rooms: of the points file.
        health: told whether the map can be used, and which rooms are not on it.
        zones: that the robot keeps out of.

    Attributes:
        house: floor and rooms; None before the first good map.
    """

    def __init__(self, rooms: Rooms, health: Health, zones: tuple[Zone, ...] = ()) -> None:
        self._rooms, self._health, self._zones = rooms, health, zones
        self.house: RoomRegions | None = None

    def hear(self, grid: Grid) -> None:
        """Part a map among the rooms; a bad one is refused."""
        try:
            house = part_rooms(floor_of(grid, zones=self._zones), self._rooms)
        except MapError as err:
            self.refuse(err)
            return
        if self.house is None:
            areas = ", ".join(f"{room.id}: {house.area(room.id):.0f}" for room in self._rooms)
            log.info("floor of the rooms [m2]: %s", areas)
        if self.house is None or self.house.lost != house.lost:
            self._tell_lost(house)
        self.house = house
        self._health.set("map", OK, "the map can be used")

    def refuse(self, err: MapError) -> None:
        """Say that a map is left out, and what that means."""
        rest = "the rooms of the map before stay" if self.house else "shares of floor seen are not known"
        text = f"rooms cannot be told from the map: {err}; {rest}"
        log.error("%s", text)
        self._health.set("map", WARN if self.house else ERROR, text)

    def _tell_lost(self, house: RoomRegions) -> None:
        """Name the rooms that the patrol refuses."""
        lost = [f"{room.title}: {house.refusal(room)}" for room in self._rooms if room.id in house.lost]
        for text in lost:
            log.error("%s, %s", text, "until then it is not looked at")
        if self._rooms.base.id in house.lost:
            log.error("the robot stays where its missions end, as its base is not on the map")
        level, text = (ERROR, "; ".join(lost)) if lost else (OK, "all rooms are on the map")
        self._health.set("rooms", level, text)
