"""Odometry noise: standard deviations of a move from gmapping's parameters."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping.parameters import GmappingParams

Array = NDArray[np.float64]

SIDEWAYS = 0.3  # share of srr that is sideways noise from forward motion, and vice versa
LEAST = (0.005, 0.005, 0.004)  # m, m, rad: least noise of any move, from the scan's timing and the wheels' play


def move_deviation(move: Pose2D, params: GmappingParams) -> Array:
    """Standard deviations of a move ahead, to the left [m] and in turning [rad], shape (3,)."""
    ahead, aside, turn = abs(move.x), abs(move.y), abs(move.yaw)
    across = SIDEWAYS * params.srr
    sigmas = (
        params.srr * ahead + params.str_ * turn + across * aside,
        params.srr * aside + params.str_ * turn + across * ahead,
        params.stt * turn + params.srt * math.hypot(ahead, aside),
    )
    return np.hypot(np.array(sigmas), np.array(LEAST))


def move_poses(poses: Array, move: Pose2D) -> Array:
    """Poses after a move in the robot's frame, shape (N, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    moved = np.empty_like(poses)
    moved[:, 0] = poses[:, 0] + c * move.x - s * move.y
    moved[:, 1] = poses[:, 1] + s * move.x + c * move.y
    moved[:, 2] = poses[:, 2] + move.yaw
    return moved
