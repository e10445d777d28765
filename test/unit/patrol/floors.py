"""Maps drawn in text, for the tests of floor, regions, coverage and viewpoints."""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.patrol.house.floor import Floor, floor_of
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.visibility.coverage import Sight, sight_on_map
from rosbot_patrol.scan import LaserScan

BEAMS = 720
NOISE = np.random.default_rng(5).standard_normal((50, BEAMS))
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

DESK = (
    "############",
    "#....    ..#",
    "#....####..#",
    "#..........#",
    "#..........#",
    "############",
)  # 6 x 3 m, unmapped behind a desk from x 2.5 to 4.5, y 2.0 to 2.5


_SIGHTS: OrderedDict[tuple[int, float, float, float], tuple[Floor, Sight]] = OrderedDict()


def sight_from(floor: Floor, x: float, y: float, reach: float) -> Sight:
    """`sight_on_map`, remembered: robots that stand, and drives that are repeated, ask for the same again and again."""
    key = id(floor), x, y, reach
    if key not in _SIGHTS:
        _SIGHTS[key] = floor, sight_on_map(floor, x, y, reach)  # with its floor, so that no other takes its id
        if len(_SIGHTS) > 4096:
            _SIGHTS.popitem(last=False)
    return _SIGHTS[key][1]


def scan_over(
    floor: Floor, pose: Pose2D, stamp: float, things: list[tuple[float, float, float]], noise: float = 0.01
) -> LaserScan:
    """A scan of a drawn house and of upright cylinders (x, y, radius) in it; angle 0 is the robot's x axis."""
    angles = -math.pi + math.tau / BEAMS * np.arange(BEAMS)
    bearings = pose.yaw + angles
    sight = sight_from(floor, pose.x, pose.y, 12.0)
    ranges = sight.lengths[np.rint((bearings % math.tau) / sight.step).astype(int) % len(sight.lengths)].copy()
    for x, y, radius in things:
        away, towards = math.hypot(x - pose.x, y - pose.y), math.atan2(y - pose.y, x - pose.x)
        aside = np.abs((bearings - towards + math.pi) % math.tau - math.pi)
        hit = aside < math.asin(min(radius / away, 1.0))
        ranges[hit] = np.minimum(ranges[hit], away - radius)
    ranges += noise * NOISE[round(stamp * 100) % len(NOISE)]
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / BEAMS,
        range_min=0.1,
        range_max=12.0,
        ranges=ranges,
    )
