"""Poses given by a person, on /initialpose or with a map, moved on by the odometry since."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, compose, invert

Array = NDArray[np.float64]
OdometryAt = Callable[[float | None], Pose2D]  # odom_from_base at a time [s] or the newest; raises TransformError


class PoseRecord(NamedTuple):
    """A geometry_msgs/PoseWithCovarianceStamped: frame, time [s], pose, covariance, shape (6, 6)."""

    frame: str
    stamp: float
    pose: Pose2D
    covariance: Array


@dataclass(frozen=True)
class InitialPose:
    """Pose to start from.

    Attributes:
        pose: map_from_base now.
        covariance: of x, y, yaw, shape (3, 3).
        odom_from_base: the odometry now, None if unknown.
        notes: assumptions made, a sentence each.
    """

    pose: Pose2D
    covariance: Array
    odom_from_base: Pose2D | None
    notes: tuple[str, ...] = ()


def taken_pose(
    pose: Pose2D, covariance: Array, *, frame: str, stamp: float, global_frame: str, odometry: OdometryAt
) -> InitialPose:
    """A given pose, moved on by the robot's motion since.

    Args:
        pose: of the robot in `frame` at `stamp`.
        covariance: of x, y, z, roll, pitch, yaw, shape (6, 6) or (36,).
        frame: without a leading slash; "" stands for the map's.
        stamp: [s]; 0 for now.
        global_frame: of the map.
        odometry: of the robot.

    Raises:
        ValueError: the pose has to be ignored; says why.
    """
    notes = [] if frame else [f"received an initial pose without a frame, it is taken as in '{global_frame}'"]
    if frame and frame != global_frame:
        raise ValueError(f"it is in frame '{frame}', expected '{global_frame}'")
    planar = np.asarray(covariance, dtype=np.float64).reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
    if not np.isfinite(planar).all():
        raise ValueError("its covariance is not finite")
    planar[2, :2] = planar[:2, 2] = 0.0  # as upstream
    motion, newest = Pose2D(), None
    try:
        then = odometry(stamp if stamp > 0.0 else None)
        newest = odometry(None)
        motion = compose(invert(then), newest)
    except TransformError as err:
        newest = None
        if stamp > 0.0:
            notes.append(f"the motion since the initial pose's stamp is not known, taken as none: {err}")
    return InitialPose(compose(pose, motion), planar, newest, tuple(notes))
