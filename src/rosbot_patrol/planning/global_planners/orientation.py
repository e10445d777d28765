"""Headings along a plan (matches global_planner's orientation filter, 1.17)."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.planning.interfaces import Array

_SAME_WAY = 0.35  # rad; a turn of more ends the straight run before the goal


class OrientationMode(IntEnum):
    """Upstream's `orientation_mode`."""

    NONE = 0
    FORWARD = 1
    INTERPOLATE = 2
    FORWARD_THEN_INTERPOLATE = 3
    BACKWARD = 4
    LEFTWARD = 5
    RIGHTWARD = 6


_TURN = {
    OrientationMode.BACKWARD: math.pi,
    OrientationMode.LEFTWARD: -math.pi / 2.0,
    OrientationMode.RIGHTWARD: math.pi / 2.0,
}


def with_orientations(points: Array, start_yaw: float, goal_yaw: float, mode: OrientationMode, window: int) -> Array:
    """Poses along the points of a plan, shape (N, 3); the last has the goal's heading.

    Args:
        points: shape (N, 2), N > 1.
        start_yaw: the robot's heading [rad].
        goal_yaw: the goal's [rad].
        mode: NONE leaves 0, the directions point along the path (or backwards, or to a side), INTERPOLATE turns evenly
            from the start's heading to the goal's, FORWARD_THEN_INTERPOLATE on the last straight run only.
        window: number of points before and after a point that give its direction.
    """
    poses = np.zeros((len(points), 3))
    poses[:, :2] = points
    poses[-1, 2] = goal_yaw
    if mode is OrientationMode.NONE:
        return poses
    if mode is OrientationMode.INTERPOLATE:
        poses[:, 2] = _evenly(start_yaw, goal_yaw, len(poses))
        return poses
    yaws = directions(points, window) + _TURN.get(mode, 0.0)
    poses[:-1, 2] = np.arctan2(np.sin(yaws), np.cos(yaws))[:-1]
    if mode is OrientationMode.FORWARD_THEN_INTERPOLATE:
        first = _last_run(poses[:, 2])
        poses[0, 2] = start_yaw
        poses[first:, 2] = _evenly(float(poses[first, 2]), goal_yaw, len(poses) - first)
    return poses


def directions(points: Array, window: int) -> NDArray[np.float64]:
    """Direction of the path at each point, from the point `window` before it to the one after it [rad], shape (N,)."""
    i = np.arange(len(points))
    steps = points[np.minimum(i + window, len(points) - 1)] - points[np.maximum(i - window, 0)]
    directions: NDArray[np.float64] = np.arctan2(steps[:, 1], steps[:, 0])
    return directions


def _last_run(yaws: NDArray[np.float64]) -> int:
    """Index where the final straight run begins."""
    i = max(len(yaws) - 3, 0)
    last = yaws[i]
    while i > 0 and abs(math.remainder(yaws[i - 1] - last, math.tau)) <= _SAME_WAY:
        i -= 1
    return i


def _evenly(first: float, last: float, count: int) -> NDArray[np.float64]:
    yaws = first + math.remainder(last - first, math.tau) * np.linspace(0.0, 1.0, count)
    wrapped: NDArray[np.float64] = np.arctan2(np.sin(yaws), np.cos(yaws))
    return wrapped
