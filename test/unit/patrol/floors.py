"""Maps drawn in text, for the tests of floor, regions, coverage and viewpoints."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.patrol.floor import Floor, floor_of
from rosbot_patrol.patrol.rooms import Room, Rooms

EDGE = 0.5  # of a letter [m]
VALUES = {"#": 100, ".": 0, " ": -1}


def drawn_map(*rows: str, resolution: float = 0.05) -> Grid:
    """A map of letters of half a metre, the last row at y = 0: # wall, . floor, blank unknown."""
    fold = round(EDGE / resolution)
    coarse = np.array([[VALUES[c] for c in row] for row in reversed(rows)], np.int8)
    cells = coarse.repeat(fold, axis=0).repeat(fold, axis=1)
    return Grid(GridInfo(resolution=resolution, width=cells.shape[1], height=cells.shape[0]), cells)


def drawn_floor(*rows: str) -> Floor:
    return floor_of(drawn_map(*rows))


def points(*places: tuple[float, float]) -> Rooms:
    """Rooms 0, 1, ... at places."""
    return Rooms(tuple(Room(id=i, name=f"room {i}", pose=Pose2D(x, y, 0.0)) for i, (x, y) in enumerate(places)))


TWO_ROOMS = (
    "###################",
    "#........#........#",
    "#........#........#",
    "#........#........#",
    "#.................#",
    "#.................#",
    "#........#........#",
    "#........#........#",
    "###################",
)  # 9.5 x 4.5 m, a door of 1 m in the middle at y 1.5 to 2.5
