from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from floors import DESK, TWO_ROOMS, drawn_floor, points

from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.house.regions import NOBODYS, RoomRegions, part_rooms
from rosbot_patrol.patrol.house.rooms import load_rooms

ROOT = Path(__file__).parents[4]


def test_two_rooms_meet_at_their_door() -> None:
    regions = part_rooms(drawn_floor(*TWO_ROOMS), points((1.5, 3.0), (8.0, 3.0)))
    xs = {i: np.nonzero(regions.mask(i))[1] * 0.1 + regions.floor.info.origin_x for i in (0, 1)}
    assert 4.5 <= xs[0].max() <= 5.0
    assert 4.5 <= xs[1].min() <= 5.0
    assert regions.area(0) + regions.area(1) == pytest.approx(114 * 0.25)


def test_a_point_beside_the_door_does_not_take_the_other_room() -> None:
    regions = part_rooms(drawn_floor(*TWO_ROOMS), points((4.2, 2.0), (8.6, 3.6)))
    assert regions.area(1) == pytest.approx(14.0, abs=0.5)


def test_rooms_of_one_hall_meet_half_way() -> None:
    hall = drawn_floor("#" * 22, *["#" + "." * 20 + "#"] * 6, "#" * 22)
    regions = part_rooms(hall, points((2.5, 2.0), (6.5, 2.0)))
    assert regions.room_at(4.3, 2.0) == 0
    assert regions.room_at(4.7, 2.0) == 1
    assert regions.room_at(4.3, 0.6) == 0
    assert regions.room_at(4.7, 3.4) == 1


def test_floor_that_nobody_gets_to_is_nobodys() -> None:
    regions = part_rooms(drawn_floor("#######", "#..#..#", "#..#..#", "#######"), points((1.0, 1.0)))
    assert regions.room_at(2.5, 1.0, within=0.3) == NOBODYS
    assert regions.room_at(1.0, 1.0) == 0


OFF = {
    "off the grid": (30.0, 30.0),
    "far off the grid": (-4000.0, 1e6),
    "just outside the house": (9.6, 3.0),
    "in the outer wall": (9.2, 3.0),
    "in the wall between two rooms": (4.75, 3.5),
    "in what is unknown": (11.2, 2.0),
}


@pytest.mark.parametrize("where", OFF)
def test_a_point_off_the_floor_takes_none_and_is_told_by_name(where: str) -> None:
    grown = [row + "    " for row in TWO_ROOMS]
    rooms = points((1.5, 3.0), OFF[where], (8.0, 3.0))
    regions = part_rooms(drawn_floor(*grown), rooms)
    assert regions.lost == (1,)
    assert regions.area(1) == 0.0
    assert regions.area(0) + regions.area(2) == pytest.approx(114 * 0.25)
    assert "rooms/room1 in the points file" in regions.refusal(rooms.find(1))
    assert regions.refusal(rooms.find(0)) == regions.refusal(rooms.find(2)) == ""


@pytest.mark.parametrize("at", [(8.95, 3.0), (0.51, 0.51), (4.45, 3.9)])
def test_a_point_close_to_a_wall_is_on_the_floor(at: tuple[float, float]) -> None:
    assert part_rooms(drawn_floor(*TWO_ROOMS), points(at)).lost == ()


def test_unmapped_floor_behind_a_desk_belongs_to_the_room_and_is_no_place_for_its_point() -> None:
    desk = drawn_floor(*DESK)
    regions = part_rooms(desk, points((3.0, 1.0)))
    assert regions.room_at(3.0, 2.25, within=0.05) == 0
    assert regions.area(0) == pytest.approx(float(desk.free.sum()) * 0.01)
    assert part_rooms(desk, points((3.0, 1.0), (3.0, 2.25))).lost == (1,)


@functools.cache
def house(name: str, file: str) -> RoomRegions:
    rooms = load_rooms(ROOT / "params" / f"{file}.yaml")
    return part_rooms(floor_of(read_map(ROOT / "maps" / f"{name}_map.yaml")), rooms)


@pytest.mark.parametrize(
    ("name", "file", "areas"),
    [
        ("rosbot", "room_points", {0: 16, 1: 11, 2: 14, 3: 11, 4: 17, 5: 25, 6: 24, 7: 32}),
        ("flat", "flat_room_points", {0: 8, 1: 16, 2: 11, 3: 7, 4: 5}),
        # the lounge and the meeting room have wide openings, so that the ends of the corridor are theirs
        ("office", "office_room_points", {0: 13, 1: 34, 2: 22, 3: 50, 4: 27, 5: 32, 6: 8, 7: 8, 8: 23, 9: 30}),
    ],
)
def test_rooms_of_our_houses(name: str, file: str, areas: dict[int, float]) -> None:
    regions = house(name, file)
    assert {i: round(regions.area(i)) for i in areas} == pytest.approx(areas, abs=1.0)
    beyond = (regions.labels == NOBODYS) & regions.floor.free  # seen through windows and into cupboards
    assert beyond.sum() < 0.005 * regions.floor.free.sum()
    for room in load_rooms(ROOT / "params" / f"{file}.yaml"):
        assert regions.room_at(room.pose.x, room.pose.y) == room.id


@pytest.mark.parametrize(
    ("place", "room"), [((-2.4, -5.6), 5), ((0.5, 2.0), 2), ((0.5, -2.0), 6), ((0.2, -6.0), 7), ((9.0, -6.5), 9)]
)
def test_places_of_the_office(place: tuple[float, float], room: int) -> None:
    assert house("office", "office_room_points").room_at(*place) == room
