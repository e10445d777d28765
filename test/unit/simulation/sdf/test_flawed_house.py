"""A world with every flaw that Gazebo's reader forgives, written by hand."""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path

import pytest

from rosbot_patrol.campaign.floor import floor_info
from rosbot_patrol.campaign.houses.strange import find_start
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import load_world

DATA = Path(__file__).parents[4] / "test" / "data" / "flawed_house"
ROBOT = Path(__file__).parents[4] / "urdf" / "rosbot.urdf"


def test_it_starts_and_says_what_it_lacks(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        world = load_world(DATA / "flawed_house.world")
    assert "is not quite XML" in caplog.text
    assert world.name == "Smith & Sons"
    assert Counter(body.name.partition("/")[0] for body in world.bodies)["house"] == 8
    assert {"table & chairs", "bed", "bed_1", "pillar", "statue"} <= {body.name for body in world.bodies}
    assert "2 files cannot be used: 1 model left out, 1 visual shown by collision shapes" in caplog.text
    assert floor_info(world.bodies).size == pytest.approx((9.8, 6.8), abs=0.1)
    start = find_start(world, DATA)
    engine = Engine(world)
    assert engine.spawn_near(load_robot(ROBOT)) != Pose2D()  # a pillar stands at the origin
    engine.remove_robot()
    engine.spawn_robot(load_robot(ROBOT), start)
    engine.close()


def test_a_stool_comes_later_without_its_cushion(caplog: pytest.LogCaptureFixture) -> None:
    stool = load_robot(DATA / "stool.urdf")
    assert (stool.left, stool.right) == ((), ())
    assert "1 mesh is left out" in caplog.text
    assert [v.shape.kind for v in stool.body.visuals] == ["cylinder"]
