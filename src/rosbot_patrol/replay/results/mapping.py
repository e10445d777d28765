"""Offline run of slam_gmapping over scans and odometry in memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.slam import Outcome, Slam
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mapping:
    """The result of a log.

    Attributes:
        slam: its state at the end.
        poses: poses of the best particle at each scan, by odometry for scans without an update, shape (N, 3).
        updates: number of updates.
        resamplings: number of resamplings.
    """

    slam: Slam
    poses: Array
    updates: int
    resamplings: int


def map_log(
    scans: Sequence[LaserScan],
    odometry: Array,
    params: GmappingParams,
    *,
    base_from_laser: Pose2D | None = None,
    heard: Callable[[int, Outcome], None] | None = None,
) -> Mapping:
    """Map a whole log.

    Args:
        scans: scans in their order.
        odometry: odometry of the robot at each scan, shape (N, 3).
        params: slam_gmapping's parameters.
        base_from_laser: pose of the level laser, None for the robot's own pose.
        heard: called with each scan's number and outcome.
    """
    slam, resamplings = Slam(params), 0
    last_update: list[int] = []
    for i, (scan, row) in enumerate(zip(scans, odometry, strict=True)):
        outcome = slam.update(scan, Pose2D(*row), base_from_laser or Pose2D())
        last_update.append(i if outcome.updated else (last_update[-1] if i else -1))
        resamplings += outcome.resampled
        if heard is not None:
            heard(i, outcome)
    poses = _poses(odometry, np.array(last_update), slam.trajectory)
    return Mapping(slam, poses, len(slam.stamps), resamplings)


def _poses(odometry: Array, last_update: NDArray[np.int64], trajectory: Array) -> Array:
    """The trajectory's poses, extended by the odometry between updates, shape (N, 3)."""
    rows, numbers = [], {int(scan): k for k, scan in enumerate(np.unique(last_update[last_update >= 0]))}
    for row, update in zip(odometry, last_update, strict=True):
        if update < 0:  # no update so far
            rows.append(Pose2D(*row))
            continue
        since = compose(invert(Pose2D(*odometry[update])), Pose2D(*row))
        rows.append(compose(Pose2D(*trajectory[numbers[int(update)]]), since))
    return np.array(rows)
