"""What moves, as a lidar sees it in the simulator: people found with place and speed, and nothing else."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.control.movers import MoverWatch
from rosbot_patrol.geometry import Pose2D, Twist2D, compose
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.simulation.engine import STEP, Engine, EngineParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).resolve().parents[3]
EVERY = round(0.1 / STEP)


@pytest.fixture
def house():
    engine = Engine(load_world(ROOT / "worlds" / "house.world"), EngineParams(seed=3))
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    yield engine
    engine.close()


def play(engine, watch, seconds, command=lambda now: Twist2D()):
    """Time and movers, ten times a second."""
    found = []
    for i in range(round(seconds / STEP)):
        engine.command(command(engine.now))
        engine.step()
        if i % EVERY == 0:
            level = engine.level_scan()
            seen = watch.see(level.scan, compose(engine.robot.odometry.pose, level.pose))
            found.append((engine.now, seen, [(*actor.pose[:2], actor.speed) for actor in engine.population.walkers]))
    return found


@pytest.mark.parametrize("speed", [0.5, 1.0, 1.4])
def test_one_who_walks_is_found_with_place_and_velocity(house, speed):
    house.population.spawn_actor("joe", "person", "", Pose2D(3.2, -0.9, 2.5))
    play(house, watch := MoverWatch(), 1.0)
    house.population.move_actor("joe", [Pose2D(0.8, 0.9, 0.0)], speed)
    track = play(house, watch, 2.6 / speed)
    errors, headings, misses = [], [], 0
    for k in range(10, len(track)):
        _, movers, [(x, y, _)] = track[k]
        if not movers:
            misses += 1
            continue
        mover = min(movers, key=lambda m: math.dist(m[:2], (x, y)))
        assert math.dist(mover[:2], (x, y)) < 0.3
        walked = np.mean(
            [track[i][2][0][2] for i in range(k - 7, k + 1)]
        )  # of the time that the velocity is taken from
        errors.append(mover.speed - walked)
        headings.append(math.atan2(mover.vy, mover.vx))
    assert misses <= 1
    assert np.abs(errors).mean() < 0.25  # the front of swinging legs is seen, not the middle of a body
    assert np.median(headings) == pytest.approx(math.atan2(1.8, -2.4), abs=0.3)


@pytest.mark.parametrize(
    "command",
    [
        lambda now: Twist2D(),
        lambda now: Twist2D(0.0, 0.0, 1.0),
        lambda now: Twist2D(0.3, 0.0, 0.8 * math.sin(now / 2.0)),
    ],
    ids=["standing", "turning", "driving"],
)
def test_where_nobody_moves_nothing_is_found(house, command):
    house.carry(Pose2D(0.5, 0.0, 0.2))
    found = play(house, MoverWatch(), 6.0, command)
    assert not [mover for _, movers, _ in found for mover in movers if mover.speed > 0.2 and mover.age > 0.25]


def test_who_stops_is_forgotten_and_who_goes_on_is_found_again(house):
    watch = MoverWatch()
    house.population.spawn_actor("joe", "person", "", Pose2D(3.0, 0.0, math.pi))
    house.population.move_actor("joe", [Pose2D(1.8, 0.0, math.pi)], 0.9)
    assert any(movers for _, movers, _ in play(house, watch, 2.0))
    play(house, watch, 3.0)
    assert not watch.movers(house.now)
    house.population.move_actor("joe", [Pose2D(2.8, 0.6, 0.0)], 0.9)
    assert any(movers for _, movers, _ in play(house, watch, 1.5))


@pytest.mark.parametrize("world", ["house", "flat", "office"])
def test_furniture_that_comes_into_view_bit_by_bit_does_not_move(world):
    """Legs of chairs, and ends of walls behind them, as the robot drives slowly by."""
    engine = Engine(load_world(ROOT / "worlds" / f"{world}.world"), EngineParams(seed=5))
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    watch = MoverWatch()
    steps = play(engine, watch, 30.0, lambda now: Twist2D(0.1, 0.0, 0.4 * math.sin(0.2 * now)))
    assert not engine.touches()
    way = math.hypot(*engine.pose[:2])
    engine.close()
    assert way > 0.5
    assert [(round(now, 1), seen) for now, seen, _ in steps if seen] == []


def ring(stamp, radius, shift=0.0):
    angles = -math.pi + np.arange(360) * math.tau / 360
    ranges = np.full(360, radius) - shift * np.cos(angles)
    return LaserScan(
        stamp=stamp, frame_id="laser", angle_min=-math.pi, angle_increment=math.tau / 360, range_min=0.1,
        range_max=10.0, ranges=ranges,
    )  # fmt: skip


def test_odometry_that_slips_makes_no_movers():
    watch = MoverWatch()
    for i in range(30):
        watch.see(ring(i * 0.1, 2.0), Pose2D())
    for i in range(30, 60):  # the wheels turn, the robot stands
        movers = watch.see(ring(i * 0.1, 2.0), Pose2D((i - 30) * 0.05, 0.0, 0.0))
        assert not [m for m in movers if m.age > 0.25 and m.speed > 0.2]


def test_time_that_goes_back_and_empty_scans_are_taken():
    watch = MoverWatch()
    assert watch.see(ring(10.0, 2.0), Pose2D()) == []
    nothing = LaserScan(
        stamp=1.0, frame_id="laser", angle_min=0.0, angle_increment=0.1, range_min=0.1, range_max=10.0,
        ranges=np.array([]),
    )  # fmt: skip
    assert watch.see(nothing, Pose2D()) == []
    lost = LaserScan(
        stamp=1.1, frame_id="laser", angle_min=0.0, angle_increment=0.1, range_min=0.1, range_max=10.0,
        ranges=np.array([math.nan, math.inf, 0.01, 5.0]),
    )  # fmt: skip
    assert watch.see(lost, Pose2D()) == []
