"""Inner loops that move particles by noisy odometry (Thrun, Burgard, Fox: Probabilistic Robotics, table 5.6)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]


@kernel("void(float64[:, ::1], float64[::1], float64[::1], float64[:, ::1])")
def move_turn_drive_turn(poses: Array, step: Array, sigma: Array, noise: Array) -> None:
    """Move each particle by a turn, a translation and a turn, each with Gaussian noise.

    Args:
        poses: x, y, yaw of the particles, changed in place, shape (N, 3).
        step: first turn [rad], drive [m], second turn [rad], shape (3,).
        sigma: their standard deviations, shape (3,).
        noise: standard normal numbers, shape (N, 3).
    """
    for i in range(poses.shape[0]):
        first = step[0] + sigma[0] * noise[i, 0]
        drive = step[1] + sigma[1] * noise[i, 1]
        second = step[2] + sigma[2] * noise[i, 2]
        heading = poses[i, 2] + first
        poses[i, 0] += drive * math.cos(heading)
        poses[i, 1] += drive * math.sin(heading)
        turned = heading + second
        poses[i, 2] = turned - 2.0 * math.pi * math.floor((turned + math.pi) / (2.0 * math.pi))


@kernel("void(float64[:, ::1], float64[::1], float64[::1], float64[:, ::1])")
def move_sliding(poses: Array, step: Array, sigma: Array, noise: Array) -> None:
    """Move each particle in a direction independent of its heading, and turn it.

    Args:
        poses: x, y, yaw of the particles, changed in place, shape (N, 3).
        step: direction against the heading [rad], way [m], turn [rad], shape (3,).
        sigma: standard deviations along the way [m], across it [m], of the turn [rad], shape (3,).
        noise: standard normal numbers, shape (N, 3).
    """
    for i in range(poses.shape[0]):
        direction = poses[i, 2] + step[0]
        along = step[1] + sigma[0] * noise[i, 0]
        across = sigma[1] * noise[i, 1]
        c, s = math.cos(direction), math.sin(direction)
        poses[i, 0] += along * c - across * s
        poses[i, 1] += along * s + across * c
        turned = poses[i, 2] + step[2] + sigma[2] * noise[i, 2]
        poses[i, 2] = turned - 2.0 * math.pi * math.floor((turned + math.pi) / (2.0 * math.pi))
