"""How actors walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.simulation.walkers import Walker

DT = 0.005


def person() -> Walker:
    return Walker("joe", "person", "visitor", Pose2D(), np.random.default_rng(0))


def walk(walker: Walker, seconds: float, robot: Pose2D | None = None) -> None:
    for _ in range(round(seconds / DT)):
        walker.step(DT, robot)


def test_walks_at_its_speed_and_turns_to_where_it_goes() -> None:
    joe = person()
    joe.walk([Pose2D(4.0, 0.0, 0.0)], 1.0)
    walk(joe, 2.0)
    assert joe.pose == pytest.approx((2.0, 0.0, 0.0), abs=0.02)
    assert joe.is_walking
    walk(joe, 3.0)
    assert joe.pose[:2] == pytest.approx((4.0, 0.0), abs=0.06)
    assert not joe.is_walking


def test_turns_before_it_walks_back_and_ends_as_told() -> None:
    joe = person()
    joe.walk([Pose2D(-1.0, 0.0, 1.0)], 1.0)
    walk(joe, 0.3)
    assert abs(joe.pose.x) < 0.01
    walk(joe, 4.0)
    assert joe.pose == pytest.approx((-1.0, 0.0, 1.0), abs=0.06)


def test_goes_round_for_ever_when_told_to_loop() -> None:
    joe = person()
    joe.walk([Pose2D(1.0, 0.0), Pose2D(0.0, 0.0)], 1.0, loop=True)
    seen = set()
    for _ in range(12):
        walk(joe, 1.0)
        seen.add(round(joe.pose.x, 1))
    assert len(seen) > 2
    assert all(-0.1 <= x <= 1.1 for x in seen)


def test_speed_zero_and_one_point_put_it_there() -> None:
    joe = person()
    joe.walk([Pose2D(3.0, 2.0, 1.0)], 0.0)
    assert joe.pose == Pose2D(3.0, 2.0, 1.0)
    assert not joe.step(DT, None)


def test_waits_before_the_robot_and_goes_on_when_it_has_gone() -> None:
    joe = person()
    joe.walk([Pose2D(3.0, 0.0)], 1.0)
    walk(joe, 4.0, robot=Pose2D(1.5, 0.0))
    assert joe.pose.x == pytest.approx(1.08, abs=0.02)
    assert not joe.is_walking
    walk(joe, 3.0)
    assert joe.pose.x > 2.9


def test_legs_swing_while_walking_and_the_hydrant_stands() -> None:
    joe = person()
    still = joe.cut(0.16)
    assert len(still) == 2
    joe.walk([Pose2D(9.0, 0.0)], 1.0)
    widest = 0.0
    for _ in range(200):
        joe.step(DT, None)
        feet = joe.cut(0.16)
        widest = max(widest, abs(feet[0, 0] - feet[1, 0]))
    assert 0.3 < widest < 0.6
    hydrant = Walker("h", "fire_hydrant", "", Pose2D(1.0, 1.0, 0.0), np.random.default_rng(0))
    assert hydrant.cut(0.16) == pytest.approx(np.array([[1.0, 1.0, 0.14]]))
    assert not hydrant.is_warm
    assert hydrant.pose_parts() is None


@pytest.mark.parametrize("speed", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(speed: float) -> None:
    with pytest.raises(Exception, match="finite"):
        person().walk([Pose2D(1.0, 0.0)], speed)


def test_a_posture_is_held_and_an_unknown_one_is_told() -> None:
    def figure(posture: str) -> np.ndarray | None:
        return Walker("w", "person", "burglar", Pose2D(), np.random.default_rng(1), posture=posture).pose_parts()

    assert not np.allclose(figure("creeping"), figure(""))
    assert np.allclose(figure("standing"), figure(""))
    with pytest.raises(WorldError, match="cannot be 'flying', expected one of standing, sitting"):
        figure("flying")
