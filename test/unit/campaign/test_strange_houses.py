"""Drawn houses and strange worlds as houses of a campaign."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.campaign.floor import Floor, floor_info
from rosbot_patrol.campaign.houses.drawn import drawn_house_files
from rosbot_patrol.campaign.houses.files import load_house, moved_scenario, read_house_folder, scenario_files
from rosbot_patrol.campaign.houses.strange import check_start, find_start, house_of_world, moved_map
from rosbot_patrol.campaign.plan import INTRUDERS, plan_patrol, scenario_text
from rosbot_patrol.errors import MapError, WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import read_map, write_map
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.simulation.plans.catalogue import load_catalogue
from rosbot_patrol.simulation.plans.drawn_house import SEEDS
from rosbot_patrol.simulation.scenario.file import read_scenario
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.sdf.world import World, load_world
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

ROOT = Path(__file__).parents[3]
SEED = SEEDS["tests"][0] + 100
VILLA = ROOT / "test" / "data" / "villa" / "villa.world"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("campaign")


def test_a_drawn_house_is_planned_in(folder: Path) -> None:
    home = folder / "houses" / "drawn"
    files = drawn_house_files(SEED, home, load_catalogue(ROOT / "config"))
    assert read_house_folder(home) == files
    house = load_house(files)
    floor = Floor(house.bodies, house.rooms)
    assert all(len(floor.drive_to(room.id)) for room in house.rooms)
    sensors = read_sensors(str(files.sensors))
    assert [s.id for s in sensors] == [room.id for room in house.rooms if room.id]
    own = [floor.room_at(s.x + 0.3 * np.cos(s.yaw), s.y + 0.3 * np.sin(s.yaw)) == s.room for s in sensors]
    assert all(own)  # each hangs in its room and looks into it
    kinds = set()
    for number in range(6):
        patrol = plan_patrol(SEED, number, files, floor, faults=3, mix="half_empty", is_light_drawn=True)
        kinds.add(patrol.kind in INTRUDERS)
        at = folder / f"{number:04d}"
        at.mkdir()
        portable = dataclasses.replace(patrol, scenario=moved_scenario(patrol.scenario, at))
        assert portable.scenario["world"] == "../houses/drawn/house.world"
        (at / "scenario.yaml").write_text(scenario_text(portable))
        scenario = read_scenario(at / "scenario.yaml")
        assert scenario.setting.light == patrol.scenario["light"]
        assert Path(scenario.setting.world).is_file()
        assert scenario_files(patrol.house, portable.scenario, at, ROOT).rooms == files.rooms
    assert kinds == {True, False}


def test_a_strange_world_becomes_a_house(tmp_path: Path, folder: Path) -> None:
    drawn = folder / "houses" / "drawn"
    start = find_start(load_world(drawn / "house.world"), drawn / "house.world")
    assert start == Pose2D()
    home = tmp_path / "houses" / "house"
    files = house_of_world(drawn / "house.world", home, start, map_file=drawn / "map.yaml", read=load_world)
    found = read_house_folder(home)
    assert found is not None
    assert found == dataclasses.replace(files, scenario=json.loads(json.dumps(files.scenario)))
    house = load_house(files)
    assert len(house.rooms) > 2
    patrol = plan_patrol(1, 0, files, Floor(house.bodies, house.rooms))
    assert patrol.scenario["robot"] == {"x": 0.0, "y": 0.0, "yaw": 0.0}


def boxes(*walls: tuple[str, str], height: float) -> str:
    """World of boxes by their places "x y" and sizes "x y"."""
    models = "".join(
        f"<model name='w{i}'><static>1</static><pose>{at} {height / 2} 0 0 0</pose><link name='l'><collision name='c'>"
        f"<geometry><box><size>{size} {height}</size></box></geometry></collision></link></model>"
        for i, (at, size) in enumerate(walls)
    )
    return f"<sdf version='1.6'><world name='w'>{models}</world></sdf>"


def test_a_house_with_walls_that_a_person_looks_over(tmp_path: Path) -> None:
    outer = [("4 0", "0.2 6.2"), ("-4 0", "0.2 6.2"), ("0 3", "8.2 0.2"), ("0 -3", "8.2 0.2")]
    world = tmp_path / "low.world"
    world.write_text(boxes(*outer, ("0 -1.9", "0.2 2.2"), ("0 1.6", "0.2 2.8"), height=0.6))
    start = find_start(load_world(world), world)
    bodies = load_world(world).bodies
    info = dataclasses.replace(floor_info(bodies), resolution=0.05, width=172, height=132)
    write_map(str(tmp_path / "map"), floor_plan(bodies, info, height=0.1, start=start[:2]))
    files = house_of_world(world, tmp_path / "low", start, map_file=tmp_path / "map.yaml", read=load_world)
    house = load_house(files)
    floor = Floor(house.bodies, house.rooms)
    assert len(read_sensors(str(files.sensors))) == len(house.rooms) - 1 == 2
    patrols = [plan_patrol(1, number, files, floor) for number in range(5)]
    starts = [actor["start"] for patrol in patrols for actor in patrol.scenario.get("actors", ()) if "start" in actor]
    assert starts
    assert all(floor.room_at(*start[:2]) > 0 for start in starts)


def test_the_ground_before_an_open_door_is_no_floor_of_the_house(tmp_path: Path) -> None:
    world = tmp_path / "open.world"
    outer = [("4 0", "0.2 6.2"), ("-4 0", "0.2 6.2"), ("0 3", "8.2 0.2"), ("-2.3 -3", "3.6 0.2"), ("2.3 -3", "3.6 0.2")]
    world.write_text(boxes(*outer, height=2.0))
    base, hall = (
        Room(id=0, name="base", pose=Pose2D(-3.0, 0.0, 0.0)),
        Room(id=1, name="hall", pose=Pose2D(1.0, 0.0, 0.0)),
    )
    floor = Floor(load_world(world).bodies, Rooms((base, hall), "test"))
    area = floor.regions.area(0) + floor.regions.area(1)
    assert area == pytest.approx(7.8 * 5.8, abs=2.5)  # without the ground beside the walls


def test_where_a_robot_starts(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match=r"has no walls: nothing in it is 0\.\d+ m high"):
        find_start(World(), tmp_path / "empty.world")
    world = tmp_path / "box.world"
    outer = [("3 0", "0.2 6.2"), ("-3 0", "0.2 6.2"), ("0 3", "6.2 0.2"), ("0 -3", "6.2 0.2")]
    world.write_text(boxes(*outer, ("0 0", "1.5 1.5"), height=2.0))
    start = find_start(load_world(world), world)  # a pillar stands at the origin
    assert 1.0 < max(abs(start.x), abs(start.y)) < 1.6
    check_start(load_world(world), world, start)
    for place in (Pose2D(3.0, 0.0, 0.0), Pose2D(90.0, 0.0, 0.0)):
        with pytest.raises(WorldError, match=r"has no room for the robot at .*; the nearest place for it is \("):
            check_start(load_world(world), world, place)
    world.write_text(boxes(*outer, ("0 0", "5.6 5.6"), height=2.0))
    with pytest.raises(WorldError, match="has no place from which the robot reaches 6 m2 of floor"):
        find_start(load_world(world), world)


def test_a_map_that_begins_at_the_robot_is_moved_to_the_world(tmp_path: Path) -> None:
    grid = Grid(GridInfo(resolution=0.05, width=4, height=3, origin_x=-1.0, origin_y=-2.0), np.zeros((3, 4), np.int8))
    write_map(str(tmp_path / "map"), moved_map(grid, Pose2D(2.5, 1.0, 0.0)))
    info = read_map(str(tmp_path / "map.yaml")).info
    assert (info.origin_x, info.origin_y) == pytest.approx((1.5, -1.0))
    with pytest.raises(MapError, match=r"at a heading of 1\.00 rad"):
        moved_map(grid, Pose2D(0.0, 0.0, 1.0))
