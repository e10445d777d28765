"""Odometry from ticks: straight, arcs, wraps and restarts of the counters."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.drivers.bases.ticks import TicksOdometry, WheelParams

PARAMS = WheelParams(wheel_radius=0.035, track=0.23, ticks_per_turn=1440.0)
TICK = math.tau * 0.035 / 1440.0


def drive(*steps: tuple[int, int], params: WheelParams = PARAMS, start: tuple[int, int] = (0, 0)) -> TicksOdometry:
    odometry = TicksOdometry(params)
    left, right = start
    half = 1 << (params.counter_bits - 1)
    odometry.update(left, right, 0.0)
    for at, (dl, dr) in enumerate(steps, 1):
        left, right = ((value + half) % (2 * half) - half for value in (left + dl, right + dr))
        odometry.update(left, right, 0.1 * at)
    return odometry


def test_straight_ahead() -> None:
    odometry = drive(*[(100, 100)] * 10)
    assert odometry.pose == pytest.approx((1000 * TICK, 0.0, 0.0))
    assert odometry.twist.vx == pytest.approx(100 * TICK / 0.1)


def test_a_full_circle_ends_where_it_began() -> None:
    per_turn = math.tau * 0.23 / TICK / 2.0  # of each wheel, on the spot
    odometry = drive(*[(-round(per_turn / 400), round(per_turn / 400))] * 400)
    assert math.hypot(odometry.pose.x, odometry.pose.y) < 1e-9
    radius, steps = 1.0, 60
    left, right = ((radius + side * 0.115) * math.tau / TICK / steps for side in (-1.0, 1.0))
    odometry = drive(*[(round(left), round(right))] * steps)
    assert math.hypot(odometry.pose.x, odometry.pose.y) < 0.05


@pytest.mark.parametrize("bits", [8, 16, 32])
@given(start=st.integers(-(1 << 31), (1 << 31) - 1), step=st.integers(-100, 100))
def test_counters_wrap_without_a_jump(bits: int, start: int, step: int) -> None:
    half = 1 << (bits - 1)
    first = (start + half) % (2 * half) - half
    params = WheelParams(counter_bits=bits, wheel_radius=0.035, ticks_per_turn=1440.0)
    odometry = drive(*[(step, step)] * 5, params=params, start=(first, first))
    assert odometry.pose.x == pytest.approx(5 * step * TICK)
    assert odometry.restarts == 0


def test_a_restart_of_the_base_is_no_motion() -> None:
    odometry = TicksOdometry(PARAMS)
    for at, value in enumerate((90000, 90100, 0, 100)):
        odometry.update(value, value, 0.1 * at)
    assert odometry.restarts == 1
    assert odometry.pose.x == pytest.approx(200 * TICK)


def test_a_stamp_that_goes_back_adds_nothing() -> None:
    odometry = drive((100, 100))
    assert not odometry.update(300, 300, 0.05)
    assert odometry.pose.x == pytest.approx(100 * TICK)
