"""Wheel-encoder odometry: whole ticks, the radius and the track that it believes in, wheels of unequal size."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.simulation.robot.odometry import EncoderOdometry, OdometryParams

RADIUS, TRACK = 0.05, 0.3
EXACT = {"radius_error": 0.0, "track_error": 0.0}


def odometry(**params: float) -> EncoderOdometry:
    return EncoderOdometry(OdometryParams(**params), RADIUS, TRACK)


def test_it_moves_by_whole_ticks_only() -> None:
    wheels = odometry(ticks_per_turn=100.0, **EXACT)
    tick = math.tau / 100.0 * RADIUS
    places = []
    for i in range(200):
        wheels.update(0.01 * i, 0.01 * i, 0.05 * i)
        places.append(wheels.pose.x)
    steps = np.array(places) / tick
    assert np.abs(steps - np.rint(steps)).max() < 1e-9
    assert round(steps[-1]) == math.floor(1.99 / (math.tau / 100.0))
    assert len(np.unique(np.rint(steps))) == 32


def test_it_never_loses_ticks_however_often_it_is_asked() -> None:
    often, seldom = odometry(ticks_per_turn=64.0, **EXACT), odometry(ticks_per_turn=64.0, **EXACT)
    for i in range(1, 1001):
        often.update(0.013 * i, 0.013 * i, 0.01 * i)
    seldom.update(13.0, 13.0, 10.0)
    assert often.pose.x == pytest.approx(seldom.pose.x)


@pytest.mark.parametrize(
    ("params", "forward", "turn"),
    [
        (EXACT, 1.0, 1.0),
        ({"radius_error": 0.02, "track_error": 0.0}, 1.02, 1.02),
        ({"radius_error": 0.0, "track_error": 0.02}, 1.0, 1.0 / 1.02),
    ],
)
def test_what_it_believes_scales_way_and_turn(params: dict[str, float], forward: float, turn: float) -> None:
    ahead = odometry(ticks_per_turn=1e6, **params)
    ahead.update(20.0, 20.0, 1.0)
    assert ahead.pose.x == pytest.approx(20.0 * RADIUS * forward, rel=1e-4)
    assert ahead.twist.vx == pytest.approx(20.0 * RADIUS * forward, rel=1e-4)
    spin = odometry(ticks_per_turn=1e6, **params)
    spin.update(-3.0, 3.0, 1.0)
    assert spin.pose.yaw == pytest.approx(6.0 * RADIUS / TRACK * turn, rel=1e-4)


def test_a_right_wheel_that_is_larger_turns_the_robot_left_and_odometry_does_not_know() -> None:
    wheels = odometry(ticks_per_turn=1e6, radius_difference=0.02, **EXACT)
    wheels.update(20.0, 20.0, 1.0)
    assert wheels.pose.yaw == pytest.approx(-20.0 * RADIUS * 0.02 / TRACK, rel=1e-3)


def test_reset_begins_at_the_origin_without_a_jump() -> None:
    wheels = odometry()
    wheels.update(5.0, 6.0, 1.0)
    wheels.reset(5.0, 6.0, 1.0)
    wheels.update(5.0, 6.0, 1.1)
    assert wheels.pose == (0.0, 0.0, 0.0)
