"""Regions of the rooms: the map's floor, separated at doors and narrow places.

Each room grows from its point, over the widest floor first and through narrow places last (the watershed of Meyer 1992
on the clearance), so that two rooms meet at the door between them. Rooms of one hall meet half-way. A part of the house
without a room point belongs to the room with the widest passage to it. A room with a point off the floor (off the map,
in a wall, in unknown space) has no region: the nearest floor may belong to another room, or lie beyond a wall.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.patrol.house.floor import Floor, Mask
from rosbot_patrol.patrol.house.rooms import Room, Rooms

NOBODYS = -1
_LEVEL = 0.05  # step between two levels of the flood [m]
_STEPS = [(dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


class RoomRegions:
    """Floor of each room.

    Attributes:
        floor: of the map.
        labels: id of the room of each cell, NOBODYS without floor or a path to it.
        lost: ids of rooms with a point off the floor.
    """

    def __init__(self, floor: Floor, labels: NDArray[np.int16], lost: tuple[int, ...]) -> None:
        self.floor, self.labels, self.lost = floor, labels, lost

    def refusal(self, room: Room) -> str:
        """Reason why a room cannot be searched, "" if it can."""
        if room.id not in self.lost:
            return ""
        return (
            f"its point ({room.pose.x:.2f}, {room.pose.y:.2f}) is not on free floor of the map; correct"
            f" rooms/room{room.id} in the points file, or the map"
        )

    def mask(self, room_id: int) -> Mask:
        """Mask of a room's floor."""
        found: Mask = self.labels == room_id
        return found

    def area(self, room_id: int) -> float:
        """Area of a room's floor [m^2]."""
        return float(self.mask(room_id).sum()) * self.floor.cell_area

    def room_at(self, x: float, y: float, within: float = 0.5) -> int:
        """Room at a point or within a distance of it [m], NOBODYS if there is none."""
        cell = self.floor.nearest(self.labels != NOBODYS, x, y, within)
        return NOBODYS if cell is None else int(self.labels[cell[1], cell[0]])


def part_rooms(floor: Floor, rooms: Rooms) -> RoomRegions:
    """Divide a floor among rooms."""
    labels = np.full(floor.info.shape, NOBODYS, np.int16)
    levels = np.ceil(floor.clearance / _LEVEL - 1e-9).astype(int)
    seeds, lost = [], []
    for room in rooms:
        if not floor.is_free(room.pose.x, room.pose.y):
            lost.append(room.id)
            continue
        cell = floor.info.cell_of(room.pose.x, room.pose.y)
        seeds += [(room.id, ix, iy) for ix, iy in _climb(levels, *cell) if labels[iy, ix] == NOBODYS]
        labels[cell[1], cell[0]] = room.id
    _flood(levels, labels, seeds)
    return RoomRegions(floor, labels, tuple(lost))


def _climb(levels: NDArray[np.int64], ix: int, iy: int) -> list[tuple[int, int]]:
    """Cells from one to the widest place around it, each wider than the previous one."""
    path = [(ix, iy)]
    while True:
        around = [(ix + dx, iy + dy) for dx, dy, _ in _STEPS if levels[iy + dy, ix + dx] > levels[iy, ix]]
        if not around:
            return path
        ix, iy = max(around, key=lambda cell: levels[cell[1], cell[0]])
        path.append((ix, iy))


def _flood(levels: NDArray[np.int64], labels: NDArray[np.int16], seeds: list[tuple[int, int, int]]) -> None:
    """Assign each cell to the room that reaches it first: by the widest path, then the shortest on its level."""
    taken = bytearray(levels.size)
    width = levels.shape[1]
    level_of, label_of = levels.ravel().tolist(), labels.ravel()
    steps = [(dx + dy * width, length) for dx, dy, length in _STEPS]
    queue: list[tuple[int, float, int, int]] = []
    for room, ix, iy in seeds:
        cell = ix + iy * width
        heapq.heappush(queue, (-level_of[cell], 0.0, room, cell))
    while queue:
        height, gone, room, cell = heapq.heappop(queue)
        if taken[cell]:
            continue
        taken[cell] = 1
        label_of[cell] = room
        for step, length in steps:
            beside = cell + step
            level = level_of[beside]
            if level and not taken[beside]:
                # counting restarts at a narrower level: the floor along a wall belongs to the space that it borders
                heapq.heappush(queue, (max(height, -level), gone * (-level <= height) + length, room, beside))
