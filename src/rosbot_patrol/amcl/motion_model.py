"""The four odometry models of amcl.

`diff` and `omni` use variances as standard deviations, as upstream's deprecated models do. `diff-corrected` and
`omni-corrected` are the models of Probabilistic Robotics, section 5.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl import motion_kernels as kernels
from rosbot_patrol.geometry import Pose2D, angle_difference

Array = NDArray[np.float64]
MotionModelName = Literal["diff", "omni", "diff-corrected", "omni-corrected"]
MOTION_MODELS = ("diff", "omni", "diff-corrected", "omni-corrected")

_STILL = 0.01  # m; a shorter motion has no meaningful direction


@dataclass(frozen=True, kw_only=True)
class OdometryNoise:
    """alpha 1: rotation from rotation, 2: rotation from translation, 3: translation from translation, 4: translation
    from rotation, 5: sideways motion from translation (only `omni`).
    """

    alpha1: float = 0.2
    alpha2: float = 0.2
    alpha3: float = 0.2
    alpha4: float = 0.2
    alpha5: float = 0.2


def move_particles(
    poses: Array, start: Pose2D, end: Pose2D, name: str, alphas: OdometryNoise, *, rng: np.random.Generator
) -> None:
    """Move particles in place by the odometry from `start` to `end`, each with its own noise."""
    deviation = math.sqrt if name.endswith("-corrected") else float
    noise = rng.standard_normal(poses.shape)
    if name.startswith("omni"):
        kernels.move_sliding(poses, *_slide(start, end, alphas, deviation), noise)
    else:
        kernels.move_turn_drive_turn(poses, *_turn_drive_turn(start, end, alphas, deviation), noise)


def _turn_drive_turn(
    start: Pose2D, end: Pose2D, a: OdometryNoise, deviation: Callable[[float], float]
) -> tuple[Array, Array]:
    """Turn, drive, turn, and their standard deviations, each of shape (3,)."""
    way = math.hypot(end.x - start.x, end.y - start.y)
    first = 0.0 if way < _STILL else angle_difference(math.atan2(end.y - start.y, end.x - start.x), start.yaw)
    second = angle_difference(angle_difference(end.yaw, start.yaw), first)
    turn1, turn2 = _turn_size(first), _turn_size(second)  # driving backwards is not a half turn
    sigma = np.array(
        [
            deviation(a.alpha1 * turn1**2 + a.alpha2 * way**2),
            deviation(a.alpha3 * way**2 + a.alpha4 * (turn1**2 + turn2**2)),
            deviation(a.alpha1 * turn2**2 + a.alpha2 * way**2),
        ]
    )
    return np.array([first, way, second]), sigma


def _turn_size(turn: float) -> float:
    return min(abs(turn), abs(angle_difference(turn, math.pi)))


def _slide(start: Pose2D, end: Pose2D, a: OdometryNoise, deviation: Callable[[float], float]) -> tuple[Array, Array]:
    """Direction, distance and turn, and their standard deviations, each of shape (3,)."""
    way = math.hypot(end.x - start.x, end.y - start.y)
    turn = angle_difference(end.yaw, start.yaw)
    direction = angle_difference(math.atan2(end.y - start.y, end.x - start.x), start.yaw)
    sigma = np.array(
        [
            deviation(a.alpha3 * way**2 + a.alpha1 * turn**2),
            deviation(a.alpha1 * turn**2 + a.alpha5 * way**2),
            deviation(a.alpha4 * turn**2 + a.alpha2 * way**2),
        ]
    )
    return np.array([direction, way, turn]), sigma
