"""Engines with the ROSbot in them, closed after each test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sdf.world import World
from rosbot_patrol.simulation.sensors.motion_sensors import SensorPlace

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def build() -> Iterator[object]:
    engines: list[Engine] = []

    def make(*bodies: Body, robot: bool = True, sensors: tuple[SensorPlace, ...] = (), **parts: object) -> Engine:
        engine = Engine(World(bodies=bodies), EngineParams(**parts), sensors=sensors)  # type: ignore[arg-type]
        if robot:
            engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
        engines.append(engine)
        return engine

    yield make
    for engine in engines:
        engine.close()
