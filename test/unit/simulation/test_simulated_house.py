"""The shipped house: rooms, sensors and world belong together."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from rosbot_patrol import params
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scene.slices import slice_bodies
from rosbot_patrol.simulation.scene.ways import EYE_LEVEL
from rosbot_patrol.simulation.sdf.world import load_world
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

ROOT = Path(__file__).parents[3]
WORLD = load_world(ROOT / "worlds" / "house.world")
ROOMS = {
    int(key.removeprefix("room")): (float(room["x"]), float(room["y"]))
    for key, room in yaml.safe_load((ROOT / "params" / "room_points.yaml").read_text())["rooms"].items()
}
SENSORS = [
    params.load(SensorPlace, item)
    for item in yaml.safe_load((ROOT / "config" / "house_sensors.yaml").read_text())["sensors"]
]


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_the_robot_has_room_to_turn_at_each_room_point(room: int) -> None:
    for height in (0.05, 0.158):
        x, y = ROOMS[room]
        assert slice_bodies(WORLD.bodies, height).cast(x, y, 0.0, math.tau / 360, 360, longest=50.0).min() > 0.9


def test_each_room_but_the_base_has_a_sensor() -> None:
    assert sorted(s.room for s in SENSORS) == sorted(r for r in ROOMS if r != 0)
    assert all(s.id == s.room for s in SENSORS)


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: f"sensor{s.id}")
def test_a_sensor_hangs_on_a_wall_and_notices_who_crosses_its_room(sensor: SensorPlace) -> None:
    eye_level = slice_bodies(WORLD.bodies, EYE_LEVEL)
    assert eye_level.cast(sensor.x, sensor.y, 0.0, math.tau / 360, 360, longest=50.0).min() < 0.15
    x, y = ROOMS[sensor.room]
    across = math.atan2(y - sensor.y, x - sensor.x) + math.pi / 2
    engine = Engine(WORLD, sensors=[sensor])
    name = engine.population.spawn_actor(
        "", "person", "", Pose2D(x - 0.6 * math.cos(across), y - 0.6 * math.sin(across), 0.0)
    )
    engine.population.move_actor(name, [Pose2D(x + 0.6 * math.cos(across), y + 0.6 * math.sin(across), 0.0)], 0.8)
    for _ in range(600):
        engine.step()
    fired = (sensor.id, True) in engine.motion_sensors.changes(engine.now)
    engine.close()
    assert fired
