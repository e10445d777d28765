"""Free floor of a map, and the places on it that a scan supports."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.scan_model.sensor_model import Beams, SensorModel
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.occupancy import FREE

Array = NDArray[np.float64]

SHARPNESS = 20.0  # weight of a candidate's fit
JITTER = (0.08, 0.08, 0.06)  # added to a candidate, because candidates are drawn on a raster [m, m, rad]


class Floor:
    """The free cells of a map.

    Args:
        grid: the map.
        rng: source of random numbers.
    """

    def __init__(self, grid: Grid, rng: np.random.Generator) -> None:
        self._info = grid.info
        self._rng = rng
        self._free = np.flatnonzero(grid.cells == FREE)

    @property
    def area(self) -> float:
        """Free floor [m2]."""
        return len(self._free) * self._info.resolution**2

    def random_poses(self, count: int) -> Array:
        """Poses on free cells, any heading, shape (count, 3); the map must have free floor."""
        iy, ix = np.divmod(self._rng.choice(self._free, count), self._info.width)
        poses = self._rng.random((count, 3))
        poses[:, 0] = self._info.origin_x + (ix + poses[:, 0]) * self._info.resolution
        poses[:, 1] = self._info.origin_y + (iy + poses[:, 1]) * self._info.resolution
        poses[:, 2] = (2.0 * poses[:, 2] - 1.0) * math.pi
        return poses

    def likely_poses(self, model: SensorModel, beams: Beams, *, tried: int, count: int) -> Array:
        """Poses that a scan supports: the best of many random ones (sensor resetting, Lenser and Veloso 2000).

        Args:
            model: weighs poses; a wide one finds more, because few random poses are close to the right one.
            beams: of the scan.
            tried: number of random poses.
            count: number of poses to return.
        """
        poses = self.random_poses(tried)
        weighing = model.weigh(poses, beams)
        if weighing is None:
            return poses[:count]
        weights = np.cumsum(np.exp(SHARPNESS * (weighing.fit - weighing.fit.max())))
        evenly = (np.arange(count) + self._rng.random()) / count * weights[-1]
        chosen = poses[np.minimum(np.searchsorted(weights, evenly, side="right"), tried - 1)]
        spread: Array = chosen + self._rng.standard_normal(chosen.shape) * np.array(JITTER)
        return spread
