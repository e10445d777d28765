"""Where the robot is now: the newest of odometry and map, none of them too old."""

from __future__ import annotations

import math

import pytest

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.patrol.senses.robot_place import RobotPlace

NOW = 1000.0


class Frames:
    """Transforms by the frames' names, with their stamps."""

    def __init__(self, *, odom: float = NOW, correction: float = NOW) -> None:
        self.known = {
            ("odom", "base_link"): (Pose2D(1.0, 0.0, 0.5), odom),
            ("map", "odom"): (Pose2D(0.0, 2.0, math.pi / 2), correction),
        }

    def lookup_stamped(self, target: str, source: str) -> tuple[Pose2D, float]:
        if (target, source) not in self.known:
            raise TransformError(target, source, "they are not connected")
        return self.known[target, source]


def place(**stamps: float) -> RobotPlace:
    return RobotPlace(Frames(**stamps), InputParams())


def test_the_newest_of_both_are_put_together() -> None:
    where = place(odom=NOW - 0.02, correction=NOW - 0.4)
    assert where.pose(NOW) == pytest.approx((0.0, 3.0, math.pi / 2 + 0.5))
    assert where.yaw(NOW) == 0.5
    assert where.problem == ""


@pytest.mark.parametrize("ahead", [0.1, 1.0, 5.0])
def test_a_localisation_may_stamp_ahead_by_its_tolerance(ahead: float) -> None:
    assert place(correction=NOW + ahead).pose(NOW) is not None


def test_a_slow_localisation_is_borne_with_and_a_dead_one_is_not() -> None:
    assert place(correction=NOW - 1.9).pose(NOW) is not None
    dead = place(correction=NOW - 2.1)
    assert dead.pose(NOW) is None
    assert "does the localisation (amcl) still run?" in dead.problem
    assert dead.yaw(NOW) == 0.5  # a turn that was begun goes on


@pytest.mark.parametrize("late", [-0.6, 0.6, 3600.0])
def test_odometry_that_is_not_of_now_gives_neither(late: float) -> None:
    where = place(odom=NOW - late)
    assert where.pose(NOW) is None
    assert where.yaw(NOW) is None
    assert "odom" in where.problem


def test_a_map_that_is_fixed_to_odom_has_no_age() -> None:
    assert place(correction=0.0).pose(NOW) is not None


def test_unknown_frames_give_none_and_the_reason() -> None:
    where = RobotPlace(Frames(), InputParams(map_frame="other"))
    assert where.pose(NOW) is None
    assert "'other'" in where.problem


def test_how_old_is_a_parameter() -> None:
    frames = Frames(odom=NOW - 2.0, correction=NOW - 5.0)
    assert RobotPlace(frames, InputParams(pose_timeout=3.0, map_timeout=6.0)).pose(NOW) is not None
    assert RobotPlace(frames, InputParams(pose_timeout=3.0, map_timeout=4.0)).pose(NOW) is None
