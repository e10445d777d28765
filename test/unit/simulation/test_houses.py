"""The flat and the office: plan, world, map, room points, sensors and demonstration belong together."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.distance_kernels import bounded_distances
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.maps.occupancy import FREE, OCCUPIED
from rosbot_patrol.maps.raster import flood
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.scene.slices import slice_bodies
from rosbot_patrol.simulation.sdf.world import World, load_world
from rosbot_patrol.simulation.sensors.motion_sensors import MotionSensorParams, SensorPlace, bearing_in_cone
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

ROOT = Path(__file__).parents[3]
EYES = 1.3  # height [m]
LIDAR = 0.158
AROUND = 0.20  # radius of the circle around the robot's footprint of 0.28 m [m]
HOUSES = ("flat", "office")
FLOOR_AREA = {"flat": (58.0, 66.0), "office": (250.0, 300.0)}


@functools.cache
def world_of(house: str) -> World:
    return load_world(ROOT / "worlds" / f"{house}.world")


@functools.cache
def rooms_of(house: str) -> dict[int, Pose2D]:
    return {room.id: Pose2D(*room.pose) for room in load_rooms(ROOT / "params" / f"{house}_room_points.yaml")}


def sensors_of(house: str) -> list[SensorPlace]:
    return read_sensors(str(ROOT / "config" / f"{house}_sensors.yaml"))


def plan_of(house: str) -> dict:
    return yaml.safe_load((ROOT / "config" / f"{house}_plan.yaml").read_text())


EACH_ROOM = [(house, room) for house in HOUSES for room in rooms_of(house)]
EACH_SENSOR = [(house, sensor) for house in HOUSES for sensor in sensors_of(house)]


@pytest.mark.parametrize(("house", "room"), EACH_ROOM)
def test_the_robot_has_room_to_turn_at_each_room_point(house: str, room: int) -> None:
    for height in (0.02, 0.1, LIDAR, 0.24):
        x, y, _ = rooms_of(house)[room]
        gap = slice_bodies(world_of(house).bodies, height).cast(x, y, 0.0, math.tau / 360, 360, longest=50.0).min()
        assert gap > 0.5, f"{gap:.2f} m at the height {height}"


@pytest.mark.parametrize("house", HOUSES)
def test_every_room_can_be_reached_from_the_start(house: str) -> None:
    grid = read_map(ROOT / "maps" / f"{house}_map.yaml")
    cells = math.ceil(AROUND / grid.info.resolution)
    blocked = np.argwhere(grid.cells != 0)
    is_open = np.ones(grid.cells.shape, bool)
    for dy in range(-cells, cells + 1):
        for dx in range(-cells, cells + 1):
            if math.hypot(dx, dy) * grid.info.resolution <= AROUND:
                place = np.clip(blocked + np.array([dy, dx]), 0, np.array(is_open.shape) - 1)
                is_open[place[:, 0], place[:, 1]] = False
    reached = flood(is_open, *grid.info.cell_of(0.0, 0.0))
    for room, point in rooms_of(house).items():
        ix, iy = grid.info.cell_of(point.x, point.y)
        assert reached[iy, ix], f"room {room}"


@pytest.mark.parametrize("house", HOUSES)
def test_doors_are_wide_and_the_house_has_the_size_it_says(house: str) -> None:
    plan = plan_of(house)
    doors = [o for wall in plan["walls"] for o in wall.get("openings", []) if not o.get("sill")]
    assert len(doors) >= len(rooms_of(house)) - 1
    assert min(door["width"] for door in doors) >= 0.8
    corners = np.array([corner for wall in plan["walls"] for corner in (wall["from"], wall["to"])])
    low, high = FLOOR_AREA[house]
    assert low <= float(np.prod(np.ptp(corners, axis=0))) <= high


@pytest.mark.parametrize("house", HOUSES)
def test_the_map_is_that_of_the_world(house: str) -> None:
    found = read_map(ROOT / "maps" / f"{house}_map.yaml")
    true = floor_plan(world_of(house).bodies, found.info, height=LIDAR, start=(0.0, 0.0))
    gaps = bounded_distances(true.cells == OCCUPIED, 10)
    assert np.mean(gaps[found.cells == OCCUPIED] < 1.5) > 0.95
    assert np.mean(found.cells[true.cells == FREE] == FREE) > 0.95
    assert found.cells.size < 200_000


@pytest.mark.parametrize("house", HOUSES)
def test_the_robot_starts_and_every_name_is_its_own(house: str) -> None:
    engine = Engine(world_of(house))
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    engine.step()
    assert not engine.touches()
    engine.close()
    names = [body.name for body in world_of(house).bodies]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("house", HOUSES)
def test_each_room_but_the_base_has_a_sensor_and_a_walk(house: str) -> None:
    rooms = sorted(room for room in rooms_of(house) if room != 0)
    assert [sensor.room for sensor in sensors_of(house)] == rooms
    assert all(sensor.id == sensor.room and sensor.port in (11411, 11412, 11413) for sensor in sensors_of(house))
    walks = yaml.safe_load((ROOT / "config" / f"{house}_demo.yaml").read_text())["walks"]
    assert sorted(walks) == rooms


@pytest.mark.parametrize(("house", "sensor"), EACH_SENSOR, ids=lambda v: f"sensor{getattr(v, 'id', v)}")
def test_a_sensor_hangs_on_a_wall_and_notices_who_walks_in_its_room(house: str, sensor: SensorPlace) -> None:
    walls = [body for body in world_of(house).bodies if body.kind == "wall"]
    assert slice_bodies(walls, sensor.z).cast(sensor.x, sensor.y, 0.0, math.tau / 360, 360, longest=50.0).min() < 0.15
    ahead = slice_bodies(world_of(house).bodies, sensor.z).cast(sensor.x, sensor.y, sensor.yaw, 0.1, 1, longest=50.0)[0]
    assert ahead > 1.5
    engine = Engine(world_of(house), sensors=[sensor])
    walk = yaml.safe_load((ROOT / "config" / f"{house}_demo.yaml").read_text())["walks"][sensor.room]
    path = [Pose2D(*point) for point in walk["path"]]
    name = engine.population.spawn_actor("", "person", "", path[0])
    engine.population.move_actor(name, path[1:], walk["speed"])
    fired = False
    for _ in range(1600):
        engine.step()
        fired = fired or (sensor.id, True) in engine.motion_sensors.changes(engine.now)
    engine.close()
    assert fired


@pytest.mark.parametrize(("house", "sensor"), EACH_SENSOR, ids=lambda v: f"sensor{getattr(v, 'id', v)}")
def test_a_sensor_looks_at_the_point_of_its_own_room(house: str, sensor: SensorPlace) -> None:
    scene = slice_bodies(world_of(house).bodies, EYES)
    eye = (sensor.x + 0.1 * math.cos(sensor.yaw), sensor.y + 0.1 * math.sin(sensor.yaw))
    seen = [room for room, point in rooms_of(house).items() if not scene.is_blocked(eye, (point.x, point.y))]
    assert sensor.room in seen


@pytest.mark.parametrize(("house", "sensor"), EACH_SENSOR, ids=lambda v: f"sensor{getattr(v, 'id', v)}")
def test_a_sensor_notices_nobody_who_walks_in_another_room(house: str, sensor: SensorPlace) -> None:
    scene = slice_bodies(world_of(house).bodies, EYES)
    walks = yaml.safe_load((ROOT / "config" / f"{house}_demo.yaml").read_text())["walks"]
    for room, walk in walks.items():
        begin, end = np.array(walk["path"][0]), np.array(walk["path"][-1])
        seen = 0
        for share in np.linspace(0.0, 1.0, 30):
            place = Pose2D(*(begin + share * (end - begin)))
            bearing = bearing_in_cone(MotionSensorParams(), sensor, place)
            if bearing is not None:
                eye = (sensor.x + 0.1 * math.cos(bearing), sensor.y + 0.1 * math.sin(bearing))
                seen += not scene.is_blocked(eye, (place.x, place.y))
        assert (seen >= 20) if room == sensor.room else (seen == 0), f"{seen} of 30 places in room {room}"


def test_the_furniture_is_of_other_kinds_than_the_first_house_s() -> None:
    first = set(yaml.safe_load((ROOT / "config" / "house_furniture.yaml").read_text())["pieces"])
    for house in HOUSES:
        plan = plan_of(house)
        assert not first & set(plan["pieces"])
        assert {item["piece"] for item in plan["furniture"]} == set(plan["pieces"])
