"""A world as a patrol finds it: furniture moved, doors hung, and now and then one shut."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.campaign.floor import CELL, Floor
from rosbot_patrol.campaign.houses.doorways import find_doorways, leaf_cells, shuts
from rosbot_patrol.campaign.houses.files import House, load_house
from rosbot_patrol.campaign.houses.varied import vary
from rosbot_patrol.campaign.mishaps import STRANDED
from rosbot_patrol.campaign.plan import plan_patrol, scenario_text
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Room, load_rooms, save_rooms
from rosbot_patrol.simulation.scenario.file import read_scenario
from rosbot_patrol.simulation.sdf.world import load_world


@pytest.fixture(scope="module")
def varied(flat: House, flat_floor: Floor) -> tuple[House, Floor]:
    return vary(flat, flat_floor, np.random.default_rng(6))


def test_the_doorways_of_the_flat(flat_floor: Floor) -> None:
    widths = [(doorway.jambs.mean(axis=0), doorway.width) for doorway in find_doorways(flat_floor)]
    expected = [((-1.1, 0.05), 0.9), ((2.1, 0.05), 0.9), ((-0.5, 2.35), 0.9), ((1.0, 1.6), 1.1)]
    assert len(widths) == len(expected)
    for (middle, width), (where, wide) in zip(widths, expected, strict=True):
        assert middle == pytest.approx(where, abs=0.06)
        assert width == pytest.approx(wide, abs=0.05)


def test_furniture_and_corners_are_no_doorways(tmp_path: Path) -> None:
    """A bed beside a bag leaves a passage as wide as a door, and so does the corner of two walls."""
    walls = [("0 2", "6.2 0.2"), ("0 -2", "6.2 0.2"), ("3 0", "0.2 4.2"), ("-3 0", "0.2 4.2")]
    parts = [("0 1.25", "0.2 1.5"), ("0 -1.25", "0.2 1.5")]  # a doorway of 1 m
    bags = [("1.5 1.3", "0.2 1.4"), ("1.5 -1.0", "0.2 2.0")]
    box = "<geometry><box><size>{} {} 2</size></box></geometry>"
    models = "".join(
        f"<model name='{kind}_{i}'><static>1</static><pose>{at} 1 0 0 0</pose><link name='l'>"
        f"<collision name='c'>{box.format(*size.split())}</collision></link></model>"
        for kind, shapes in (("wall", walls + parts), ("bag", bags))
        for i, (at, size) in enumerate(shapes)
    )
    (tmp_path / "hall.world").write_text(f"<sdf version='1.6'><world name='w'>{models}</world></sdf>")
    rooms = [("base", -1.5), ("middle", 0.75), ("east", 2.3)]
    save_rooms(
        tmp_path / "rooms.yaml", [Room(id=i, name=n, pose=Pose2D(x, 0.0, 0.0)) for i, (n, x) in enumerate(rooms)]
    )
    bodies = load_world(tmp_path / "hall.world").bodies
    (doorway,) = find_doorways(Floor(bodies, load_rooms(tmp_path / "rooms.yaml")))
    assert doorway.jambs.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.06)
    assert doorway.width == pytest.approx(1.0, abs=0.05)


def test_a_shut_door_bars_the_rooms_behind_it(flat_floor: Floor) -> None:
    *_, bath_or_bedroom, living = find_doorways(flat_floor)
    by_name = {room.name: room.id for room in flat_floor.rooms}
    door = living.door("door", at_second=False, turns_left=True)
    barred = {name for name, room in by_name.items() if room and shuts(door, flat_floor, room)}
    assert barred == {"living room and kitchen", "bedroom"}
    door = bath_or_bedroom.door("door", at_second=True, turns_left=False)
    assert {name for name, room in by_name.items() if room and shuts(door, flat_floor, room)} == {"bedroom"}


def test_an_open_leaf_stands_where_nothing_else_does(flat_floor: Floor) -> None:
    west = find_doorways(flat_floor)[0]
    door = west.door("door", at_second=False, turns_left=True)
    leaf = leaf_cells(door, flat_floor)
    assert leaf.sum() == pytest.approx(0.7 / CELL, abs=2.0)
    folded = leaf_cells({**door, "swing": 3.1}, flat_floor)  # back along the wall
    assert not flat_floor.open[folded].any()
    assert not leaf_cells({**door, "hinge": [90.0, 0.0, 0.0]}, flat_floor).any()


def test_a_varied_house_has_moved_furniture_and_doors_and_every_room_is_reached(
    flat: House, flat_floor: Floor, varied: tuple[House, Floor]
) -> None:
    house, floor = varied
    entries = house.files.scenario
    assert entries["furniture"]
    assert entries["doors"]
    for room in flat_floor.rooms:
        before, after = (len(each.drive_to(room.id)) for each in (flat_floor, floor))
        assert 0 < after <= 1.2 * before
    moved = {each["name"] for each in entries["furniture"]}
    was = {body.name: body.pose for body in flat.bodies}
    assert {b.name for b in house.bodies if b.name in was and not np.allclose(b.pose, was[b.name])} == moved
    again, _ = vary(flat, flat_floor, np.random.default_rng(6))
    assert again.files == house.files
    leaves = [leaf_cells(door, flat_floor) for door in entries["doors"]]
    assert all(flat_floor.open[leaf].all() for leaf in leaves)
    read = load_house(house.files)
    assert [body.name for body in read.bodies] == [body.name for body in house.bodies]


def test_now_and_then_the_door_to_the_room_is_shut(varied: tuple[House, Floor], tmp_path: Path) -> None:
    house, floor = varied
    patrols = [plan_patrol(5, number, house.files, floor) for number in range(30)]
    shut = [patrol for patrol in patrols if patrol.mishap]
    assert 0 < len(shut) < 10
    for patrol in shut:
        (door,) = [door for door in patrol.scenario["doors"] if door["opening"] == 0.0]
        assert patrol.mishap == f"the door {door['name']} is shut"
        assert patrol.allowed == STRANDED
        assert shuts(door, floor, patrol.room)
        file = tmp_path / f"{patrol.number}.yaml"
        file.write_text(scenario_text(patrol))
        assert any(each.name == door["name"] and each.opening == 0.0 for each in read_scenario(file).doors)
        behind = load_house(replace(house.files, scenario={**house.files.scenario, "doors": patrol.scenario["doors"]}))
        assert not len(Floor(behind.bodies, behind.rooms).drive_to(patrol.room))
