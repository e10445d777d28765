"""The odometry's prior on a pose: a mixture of two Gaussians about its guess.

The narrow one is as wide as the odometry's errors were so far, and the wide one as the parameters say. So good odometry
is believed where a scan hardly fits, and a slip costs no more than `rare`, however far it went.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]

RARE = 3.0  # minus the logarithm of how often the wide Gaussian applies, relative to the narrow one


@kernel()
def fill_prior(heading: float, deviation: Array, scale: Array, prior: Array) -> float:
    """Information of both Gaussians.

    Args:
        heading: of the robot before the move [rad].
        deviation: of the move ahead, to the left [cells] and in turning [rad], shape (3,); the wide Gaussian's.
        scale: the narrow one's, as shares of these, shape (3,).
        prior: filled with the information of the narrow and the wide one in the map's axes, shape (2, 3, 3).

    Returns:
        Cost by which the wide one is rarer, see `prior_cost`.
    """
    c, s = math.cos(heading), math.sin(heading)
    prior[:] = 0.0
    rare = RARE
    for i in range(2):
        u, v, w = deviation[0], deviation[1], deviation[2]
        if i == 0:
            u, v, w = u * scale[0], v * scale[1], w * scale[2]
            rare -= math.log(scale[0]) + math.log(scale[1]) + math.log(scale[2])
        ahead, aside = 1.0 / u**2, 1.0 / v**2
        prior[i, 0, 0], prior[i, 1, 1] = c * c * ahead + s * s * aside, s * s * ahead + c * c * aside
        prior[i, 0, 1] = prior[i, 1, 0] = c * s * (ahead - aside)
        prior[i, 2, 2] = 1.0 / w**2
    return rare


@kernel()
def half_square(dx: float, dy: float, turn: float, information: Array) -> float:
    """Half the squared Mahalanobis length of a distance from the guess."""
    squared: float = (
        information[0, 0] * dx * dx
        + 2.0 * information[0, 1] * dx * dy
        + information[1, 1] * dy * dy
        + information[2, 2] * turn * turn
    )
    return 0.5 * squared


@kernel()
def prior_cost(pose: Array, guess: Array, prior: Array, rare: float) -> float:
    """Minus the logarithm of the mixture's density, up to a constant; poses of shape (3,)."""
    dx, dy, turn = pose[0] - guess[0], pose[1] - guess[1], pose[2] - guess[2]
    a, b = half_square(dx, dy, turn, prior[0]), half_square(dx, dy, turn, prior[1]) + rare
    return min(a, b) - math.log1p(math.exp(-abs(a - b)))


@kernel()
def add_prior(pose: Array, guess: Array, prior: Array, rare: float, information: Array, slope: Array) -> None:
    """Set the normal equations of a pose, information (3, 3) and slope (3,), to the mixture's share.

    Each Gaussian counts by its part of the density at the pose.
    """
    dx, dy, turn = pose[0] - guess[0], pose[1] - guess[1], pose[2] - guess[2]
    a, b = half_square(dx, dy, turn, prior[0]), half_square(dx, dy, turn, prior[1]) + rare
    narrow = 1.0 / (1.0 + math.exp(max(min(a - b, 500.0), -500.0)))
    for i in range(3):
        for j in range(3):
            information[i, j] = narrow * prior[0, i, j] + (1.0 - narrow) * prior[1, i, j]
        slope[i] = information[i, 0] * dx + information[i, 1] * dy + information[i, 2] * turn
