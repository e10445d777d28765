"""The robot's own programs in one process: it gets there, it repeats, and it stands for who never yields."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from rosbot_patrol.closed_loop.loop import ClosedLoop, read_profile
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).resolve().parents[3]
HOME = Pose2D()
GOAL = Pose2D(3.0, -0.2, 1.0)


@pytest.fixture
def build():
    engines = []

    def make(start: Pose2D = HOME, seed: int = 1) -> ClosedLoop:
        engine = Engine(load_world(ROOT / "worlds" / "house.world"), EngineParams(seed=seed))
        engines.append(engine)
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"), start)
        known = read_map(ROOT / "maps" / "rosbot_map.yaml")
        return ClosedLoop(engine, known, read_profile(ROOT / "config" / "tuned"), seed=seed)

    yield make
    for engine in engines:
        engine.close()


def test_it_gets_there_and_the_same_again(build):
    drives = []
    for _ in range(2):
        loop = build()
        drive = loop.drive_to(GOAL, 60.0)
        assert drive.outcome is not None
        assert drive.outcome.text == "Goal reached."
        assert drive.error < 0.12
        assert (drive.contacts, drive.recoveries, drive.waited) == ([], [], 0.0)
        drives.append((drive.seconds, loop.engine.pose))
    assert drives[0] == drives[1]


def test_a_goal_in_a_wall_is_given_up_in_words(build):
    loop = build()
    drive = loop.drive_to(Pose2D(1.915, 4.075, 0.0), 120.0)
    assert drive.outcome is not None
    assert drive.outcome.text.startswith("Failed to find a valid plan.")
    assert drive.contacts == []


@pytest.mark.parametrize(
    ("start", "way"),
    [
        (Pose2D(), [Pose2D(4.2, -0.3, math.pi), Pose2D(-0.8, 0.1, math.pi)]),
        (Pose2D(), [Pose2D(1.4, 1.2, -1.6), Pose2D(1.6, -1.2, -1.6)]),
        (Pose2D(1.4, 0.0, 0.0), [Pose2D(-0.6, 0.1, 0.0), Pose2D(3.8, -0.3, 0.0)]),
    ],
    ids=["towards", "across", "behind"],
)
def test_it_stands_for_who_never_yields_and_goes_on(build, start, way):
    loop = build(start)
    loop.engine.population.spawn_actor("joe", "person", "", way[0])
    loop.engine.population.move_actor("joe", way[1:], 0.9, yields=False)
    left = []

    def see_out():
        if loop.engine.population.walkers and loop.engine.population.walkers[0].has_arrived:
            left.append(loop.now)
            loop.engine.population.remove("joe")

    drive = loop.drive_to(GOAL, 90.0, each_step=see_out)
    assert left
    assert drive.outcome is not None
    assert drive.outcome.succeeded
    assert drive.waited > 0.3
    assert drive.contacts == []
