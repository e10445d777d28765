"""The flat's swivel chair, whose base lies under the lidar's plane: the camera sees it, the robot goes round it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.closed_loop.loop import ClosedLoop, read_profile
from rosbot_patrol.costmap.costs import LETHAL
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).resolve().parents[3]
CHAIR = (4.55, 0.1)  # its arms reach 0.28 m
WAYS = [
    (Pose2D(2.6, 0.1, 0.0), Pose2D(5.2, 0.15)),  # right through it
    (Pose2D(5.15, 0.5, -2.8), Pose2D(2.6, 0.1)),  # and back
    (Pose2D(2.6, 0.0, 0.0), Pose2D(4.78, -0.32)),  # close to it
]


@pytest.fixture
def build():
    engines = []

    def make(start):
        engine = Engine(load_world(ROOT / "worlds" / "flat.world"), EngineParams(seed=3), make_renderer=make_renderer)
        engines.append(engine)
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"), start)
        known = read_map(ROOT / "maps" / "flat_map.yaml")
        return ClosedLoop(engine, known, read_profile(ROOT / "config" / "tuned"), seed=3)

    yield make
    for engine in engines:
        engine.close()


@pytest.mark.parametrize(("start", "goal"), WAYS)
def test_it_goes_round_the_chairs_base(build, start, goal):
    loop = build(start)
    drive = loop.drive_to(goal, 90.0)
    assert drive.outcome is not None
    assert drive.outcome.text == "Goal reached."
    assert drive.contacts == []


def test_the_plan_keeps_away_after_one_look(build):
    loop = build(WAYS[0][0])
    loop.drive_to(Pose2D(2.65, 0.1), 3.0)
    low = next(layer for layer in loop.global_costmap.obstacle_layers if layer.name == "low_obstacle_layer")
    iy, ix = np.nonzero(low._window.cells == LETHAL)
    info = loop.global_costmap.info
    x, y = info.origin_x + (ix + 0.5) * info.resolution, info.origin_y + (iy + 0.5) * info.resolution
    away = np.hypot(x - CHAIR[0], y - CHAIR[1])
    assert len(away) >= 8
    assert away.max() < 0.4  # all marks are of the chair
