"""Headings of quaternions, as messages carry them."""

import math

import pytest

from rosbot_patrol.geometry import quaternion_from_yaw, yaw_from_quaternion


@pytest.mark.parametrize("yaw", [0.0, 0.5, -2.0, math.pi])
@pytest.mark.parametrize("length", [1.0, 2.0, 0.001, -1.0])
def test_heading_of_a_quaternion_of_any_length(yaw, length):
    q = [length * part for part in quaternion_from_yaw(yaw)]
    assert yaw_from_quaternion(*q) == pytest.approx(yaw)


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (0.0, -0.0, 0.0, 0.0), (0.0, 0.0, 1e-9, 0.0)])
def test_a_quaternion_of_zeros_is_heading_0_and_said_once(q, caplog):
    what = f"the orientation of {q}"
    assert [yaw_from_quaternion(*q, what=what) for _ in range(3)] == [0.0] * 3
    assert len([m for m in caplog.messages if m.startswith(f"{what} is (0, 0, 0, 0), no quaternion")]) == 1


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_quaternion_that_is_not_finite_is_an_error(wrong):
    for at in range(4):
        q = [0.0, 0.0, 0.0, 1.0]
        q[at] = wrong
        with pytest.raises(ValueError, match="is no orientation"):
            yaw_from_quaternion(*q)
