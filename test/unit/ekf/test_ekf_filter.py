"""The filter's arithmetic: motion, Jacobian, correction, rejection, control."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.ekf.control import Control, Response
from rosbot_patrol.ekf.filter import Ekf, Measurement, motion
from rosbot_patrol.ekf.state import NAMES, SIZE, angles, from_quaternion, rotation, to_quaternion


def measured(stamp: float, variance: float = 0.01, **values: float) -> Measurement:
    whole, mask = np.zeros(SIZE), np.zeros(SIZE, bool)
    for name, value in values.items():
        whole[NAMES.index(name)], mask[NAMES.index(name)] = value, True
    return Measurement(stamp, "test", whole, np.eye(SIZE) * variance, mask)


def made() -> Ekf:
    return Ekf(np.eye(SIZE) * 0.05, np.eye(SIZE) * 1e-9)


def test_the_jacobian_is_the_derivative_of_the_motion() -> None:
    state = np.random.default_rng(3).normal(0.0, 0.6, SIZE)
    _, jacobian = motion(state, 0.2)
    for number in range(SIZE):
        step = np.zeros(SIZE)
        step[number] = 1e-6
        change = (state + step + motion(state + step, 0.2)[0]) - (state - step + motion(state - step, 0.2)[0])
        assert change / 2e-6 == pytest.approx(jacobian[:, number], abs=1e-6), NAMES[number]


def test_rotations_agree() -> None:
    rpy = (0.3, -0.7, 2.1)
    assert angles(rotation(*rpy)) == pytest.approx(rpy)
    assert from_quaternion(*to_quaternion(*rpy)) == pytest.approx(rotation(*rpy))


def test_a_steady_speed_adds_up() -> None:
    ekf = made()
    for tick in range(401):
        ekf.take(measured(tick * 0.05, vx=5.0, vy=0.0, vyaw=0.0))
    assert ekf.state[0] == pytest.approx(100.0, abs=2.0)
    assert ekf.state[1] == pytest.approx(0.0, abs=0.1)


def test_a_circle_closes() -> None:
    ekf = made()
    for tick in range(1001):
        ekf.take(measured(tick * 0.01, 1e-6, vx=1.0, vy=0.0, vyaw=math.tau / 10.0))
    assert ekf.state[:2] == pytest.approx([0.0, 0.0], abs=0.05)


def test_the_shorter_way_round_is_the_innovation() -> None:
    ekf = made()
    ekf.take(measured(0.0, yaw=3.1))
    ekf.take(measured(0.1, yaw=-3.1))
    assert abs(ekf.state[5]) > 3.09


def test_an_older_measurement_corrects_and_sets_no_clock_back() -> None:
    ekf = made()
    ekf.take(measured(1.0, vx=1.0))
    ekf.take(measured(0.5, vx=1.0))
    assert ekf.stamp == 1.0


def test_what_is_too_far_off_is_rejected() -> None:
    ekf = made()
    ekf.take(measured(0.0, x=0.0))
    far = measured(0.1, x=50.0)
    before = ekf.state.copy()
    assert not ekf.take(Measurement(far.stamp, "", far.values, far.covariance, far.mask, threshold=3.0))
    assert ekf.state == pytest.approx(before)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_no_number_does_not_count(bad: float) -> None:
    ekf = made()
    ekf.take(measured(0.0, vx=1.0))
    ekf.take(measured(0.1, 1e-6, vx=bad, vy=0.5))
    assert np.isfinite(ekf.state).all()
    assert ekf.state[7] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("variance", [0.0, -0.01])
def test_a_variance_that_is_none_harms_nothing(variance: float) -> None:
    ekf = made()
    ekf.take(measured(0.0, vx=1.0))
    ekf.take(measured(0.1, variance, vx=2.0))
    assert np.isfinite(ekf.covariance).all()
    assert ekf.state[6] == pytest.approx(2.0, abs=0.5)


def made_control(timeout: float = 0.2) -> Control:
    ones = np.ones(6)
    response = Response(np.array([1, 0, 0, 0, 0, 1], bool), 1.3 * ones, 1.5 * ones, 0.8 * ones, 1.0 * ones)
    return Control(response, timeout)


@pytest.mark.parametrize(
    ("command", "speed", "expected"),
    [
        (0.5, 0.0, 0.4),  # gain 0.8
        (5.0, 0.0, 1.3),  # the limit
        (0.0, 0.5, -0.5),  # slows down, gain 1
        (-0.5, 3.0, -1.5),  # the other way: slows down first, at the other limit
        (0.5, 0.5, 0.0),
    ],
)
def test_acceleration_by_a_command(command: float, speed: float, expected: float) -> None:
    found = made_control().accelerations(np.full(6, command), np.full(6, speed))
    assert found == pytest.approx(np.full(6, expected))


def test_a_command_that_is_old_counts_as_zero() -> None:
    ekf = made()
    ekf.control = made_control()
    ekf.take(measured(0.0, vx=0.0, vyaw=0.0))
    ekf.control.hear(np.array([1.0, 0, 0, 0, 0, 1.0]), 0.0)
    ekf.predict(0.1, 0.1)
    assert ekf.state[6] == pytest.approx(0.08)
    assert ekf.state[11] == pytest.approx(0.08)
    ekf.predict(0.5, 0.4)
    assert ekf.state[6] < 0.08
