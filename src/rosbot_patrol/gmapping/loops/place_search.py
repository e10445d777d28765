"""Search for the pose from which points lie on the walls of a map, without a good guess."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.gmapping.loops.search_kernels import fill_pyramid, find_best
from rosbot_patrol.maps.distance_kernels import bounded_distances

Array = NDArray[np.float64]

LEVELS = 5  # of the pyramid: the coarsest shift is 16 cells
BLUR = 1.5  # standard deviation of a point from its wall [cells]
FAR = 240.0  # points farther away do not set the step of the turn [cells]
STEP = 1.5  # shift of the farthest point from turn to turn [cells]
MOST_POINTS = 240
LEAST_SHARE = 0.45  # of the highest possible sum, below which no place is found


class WallField:
    """Where the walls of a map are, in several resolutions.

    Args:
        walls: which cells are walls, shape (H, W).
        origin: the map's lower left corner [cells], shape (2,).
        reach: largest shift in x and y that will be looked for [cells].
    """

    def __init__(self, walls: NDArray[np.bool_], origin: Array, reach: int) -> None:
        self._reach = reach
        pad = reach + (1 << LEVELS)
        distances = bounded_distances(np.pad(walls, pad), 5)
        self._levels = np.zeros((LEVELS, *distances.shape), dtype=np.uint8)
        self._levels[0] = np.rint(255.0 * np.exp(-0.5 * (distances / BLUR) ** 2))
        fill_pyramid(self._levels)
        self._corner = np.asarray(origin, dtype=np.float64) - pad

    def find(self, points: Array, guess: Pose2D, turn: float, *, least: float = LEAST_SHARE) -> Array | None:
        """Find the best pose within the reach and up to `turn` [rad] from a guess.

        Args:
            points: in the robot's frame [cells], shape (P, 2).
            guess: where the robot may be [cells, rad].
            turn: largest turn from it [rad].
            least: share of the highest possible sum below which no place is found.

        Returns:
            The pose, shape (3,); None if nowhere is good enough.
        """
        if len(points) == 0:
            return None
        points = points[:: -(-len(points) // MOST_POINTS)]
        far = min(max(float(np.hypot(*points.T).max()), 1.0), FAR)
        count = math.ceil(turn * far / STEP)
        turns = np.arange(-count, count + 1) * (turn / count)
        placed = np.stack([transform_points(Pose2D(guess.x, guess.y, guess.yaw + t), points) for t in turns])
        best = np.empty(4, dtype=np.int64)
        lowest = int(least * 255 * len(points))
        find_best(self._levels, np.floor(placed - self._corner).astype(np.int32), self._reach, lowest, best)
        if best[0] < 0:
            return None
        return np.array([guess.x + best[1], guess.y + best[2], guess.yaw + turns[best[0]]])
