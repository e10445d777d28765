"""For whom the robot waits."""

from __future__ import annotations

import pytest

from rosbot_patrol.control.give_way import GiveWay, GiveWayParams
from rosbot_patrol.control.movers import Mover
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D

AHEAD = Twist2D(0.36)
HERE = Pose2D()


def mover(x, y, vx, vy, age=1.0):
    return Mover(x, y, vx, vy, age)


@pytest.mark.parametrize(
    ("who", "waits"),
    [
        (mover(2.5, 0.0, -1.0, 0.0), True),  # head-on
        (mover(2.5, 0.2, -0.6, 0.0), True),
        (mover(-1.8, 0.0, 1.2, 0.0), True),  # from behind, faster
        (mover(0.9, -1.6, 0.0, 1.0), True),  # crosses ahead
        (mover(1.2, 0.8, -0.3, -0.3), True),  # near, and comes nearer
        (mover(0.4, 0.2, 0.0, 0.5), True),  # beside, passes
        (mover(3.5, 0.0, 1.0, 0.0), False),  # goes the same way, faster
        (mover(1.0, 0.0, 0.9, 0.0), False),
        (mover(2.5, 2.5, -1.0, 0.0), False),  # passes at a distance
        (mover(-1.5, 0.0, -1.0, 0.0), False),  # has passed
        (mover(3.9, 0.0, -0.3, 0.0), False),  # not yet
        (mover(1.5, 0.0, -0.1, 0.0), False),  # as good as standing: an obstacle like others
        (mover(2.0, 0.0, -1.0, 0.0, age=0.1), False),  # a flicker
        (mover(1.0, 0.0, 0.9, 0.0, age=0.4), True),  # begins to walk beside it
    ],
)
def test_waits_for_who_would_come_too_near(who, waits):
    assert bool(GiveWay().waits(AHEAD, [who], HERE, 0.0)) == waits


def test_standing_needs_no_permission_and_a_horizon_of_zero_switches_it_off():
    who = mover(1.0, 0.0, -1.0, 0.0)
    assert GiveWay().waits(STOP, [who], HERE, 0.0) == ""
    assert GiveWay(GiveWayParams(horizon=0.0)).waits(AHEAD, [who], HERE, 0.0) == ""


def test_turning_waits_only_for_who_is_close():
    turn = Twist2D(0.0, 0.0, 1.0)
    assert GiveWay().waits(turn, [mover(2.6, 0.0, -0.8, 0.0)], HERE, 0.0) == ""
    assert GiveWay().waits(turn, [mover(1.3, 0.0, -0.8, 0.0)], HERE, 0.0)


def test_it_stands_a_moment_longer_and_longer_for_who_was_beside_it():
    give_way = GiveWay()
    assert "2.5 m off" in give_way.waits(AHEAD, [mover(2.5, 0.0, -1.0, 0.0)], HERE, 0.0)
    assert "passed" in give_way.waits(AHEAD, [], HERE, 0.4)
    assert give_way.waits(AHEAD, [], HERE, 0.6) == ""
    assert give_way.waits(AHEAD, [mover(0.4, 0.2, 0.0, 0.5)], HERE, 1.0)
    assert give_way.waits(AHEAD, [], HERE, 2.4)
    assert give_way.waits(AHEAD, [], HERE, 2.6) == ""
    assert give_way.waits(AHEAD, [], HERE, 0.2) == ""  # the clock went back
