"""Rooms of a map that nobody has marked."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.house.floor import Floor, floor_of
from rosbot_patrol.patrol.house.parting import suggest_rooms
from rosbot_patrol.patrol.house.regions import part_rooms
from rosbot_patrol.patrol.house.rooms import load_rooms

ROOT = Path(__file__).parents[4]


def drawn(*rows: str) -> Floor:
    """A floor of metre-wide blocks: # wall, . floor, = a wall with a door of 0.8 m in its middle."""
    blocks = {"#": np.full((10, 10), 100), ".": np.zeros((10, 10))}
    door = np.full((10, 10), 100)
    door[1:9, :] = 0
    blocks["="] = door
    cells = np.vstack([np.hstack([blocks[c] for c in row]) for row in reversed(rows)]).astype(np.int8)
    return floor_of(Grid(GridInfo(resolution=0.1, width=cells.shape[1], height=cells.shape[0]), cells))


def test_rooms_end_at_doors() -> None:
    floor = drawn("#########", "#...=...#", "#...#...#", "#...#...#", "#########")
    rooms = suggest_rooms(floor, Pose2D(1.5, 1.5, 0.0))
    assert [room.id for room in rooms] == [0, 1, 2]
    assert rooms.base.pose == Pose2D(1.5, 1.5, 0.0)
    assert sorted(round(room.pose.x) for room in rooms if room.id) in ([2, 6], [2, 7], [3, 6], [3, 7])


def test_one_hall_is_one_room_and_the_base_is_none() -> None:
    floor = drawn("#######", "#.....#", "#.....#", "#.....#", "#######")
    assert len(suggest_rooms(floor, Pose2D(1.5, 1.5, 0.0))) == 2
    (base, room) = suggest_rooms(floor, Pose2D(3.5, 2.5, 0.0))  # its middle is taken
    assert 1.5 <= math.dist(base.pose[:2], room.pose[:2]) < 2.0
    with pytest.raises(MapError, match="has no room of 2 m2 that can be reached"):
        suggest_rooms(drawn("####", "#..#", "#..#", "####"), Pose2D(2.0, 2.0, 0.0))


def test_what_cannot_be_reached_is_no_room() -> None:
    floor = drawn("##########", "#...#...##", "#...#...##", "#...#...##", "##########")
    rooms = suggest_rooms(floor, Pose2D(1.5, 1.2, 0.0))
    assert [round(room.pose.x) for room in rooms if room.id] in ([2], [3])
    with pytest.raises(MapError, match="shows no room for the robot at its start"):
        suggest_rooms(floor, Pose2D(4.5, 2.0, 0.0))


@pytest.mark.parametrize(("name", "stem", "most"), [("flat_", "flat", 0), ("", "rosbot", 3), ("office_", "office", 1)])
def test_our_own_houses_fall_into_rooms_like_those_that_people_marked(name: str, stem: str, most: int) -> None:
    """Rooms of the tutorial's house have openings of two metres: there the floor is parted by its size only."""
    floor = floor_of(read_map(str(ROOT / "maps" / f"{stem}_map.yaml")))
    marked = load_rooms(ROOT / "params" / f"{name}room_points.yaml")
    regions = part_rooms(floor, marked)
    found = {regions.room_at(room.pose.x, room.pose.y) for room in suggest_rooms(floor, Pose2D())}
    missed = {room.id for room in marked} - found - {0}
    assert len(missed) <= most
