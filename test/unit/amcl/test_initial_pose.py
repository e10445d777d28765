"""Clicked poses: which are taken, and what the motion since does to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.amcl.initial_pose import InitialPose, taken_pose
from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D


def odometry(stamp: float | None) -> Pose2D:
    """A robot at 1 m/s that was first heard of at 10 s; now it is 12 s."""
    if stamp is not None and stamp < 10.0:
        raise TransformError("odom", "base_link", "too old")
    return Pose2D(12.0 if stamp is None else stamp, 0.0, 0.0)


def taken(*, frame: str = "map", stamp: float = 0.0, covariance: np.ndarray | None = None) -> InitialPose:
    values = np.arange(36.0) if covariance is None else covariance
    given = Pose2D(1.0, 2.0, math.pi / 2)
    return taken_pose(given, values, frame=frame, stamp=stamp, global_frame="map", odometry=odometry)


def test_a_pose_of_now_is_taken_as_it_is() -> None:
    found = taken()
    assert (found.pose, found.odom_from_base, found.notes) == (Pose2D(1.0, 2.0, math.pi / 2), Pose2D(12.0), ())
    assert found.covariance.tolist() == [[0.0, 1.0, 0.0], [6.0, 7.0, 0.0], [0.0, 0.0, 35.0]]


def test_the_motion_since_the_click_counts() -> None:
    assert taken(stamp=10.5).pose == pytest.approx((1.0, 3.5, math.pi / 2))


def test_a_motion_that_is_not_known_is_none_and_said() -> None:
    found = taken(stamp=5.0)
    assert (found.pose, found.odom_from_base) == (Pose2D(1.0, 2.0, math.pi / 2), None)
    assert found.notes[0].startswith("the motion since the initial pose's stamp is not known, taken as none: no transf")


def test_frames() -> None:
    assert taken(frame="").notes == ("received an initial pose without a frame, it is taken as in 'map'",)
    with pytest.raises(ValueError, match="it is in frame 'odom', expected 'map'"):
        taken(frame="odom")


def test_a_covariance_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="its covariance is not finite"):
        taken(covariance=np.full((6, 6), np.inf))
