"""How far each place is from the nearest obstacle of the map, cut to where there are any."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.distance_kernels import bounded_distances
from rosbot_patrol.maps.occupancy import OCCUPIED

Table = NDArray[np.float32]


@dataclass(frozen=True)
class Field:
    """A table on the grid; its border cells stand for all that lies beyond.

    Attributes:
        values: shape (H, W).
        origin_x, origin_y: lower left corner [m].
        resolution: edge of a cell [m].
    """

    values: Table
    origin_x: float
    origin_y: float
    resolution: float

    def mapped(self, values: NDArray[np.float64]) -> Field:
        """The same place with other values."""
        table = np.ascontiguousarray(values, dtype=np.float32)
        return Field(table, self.origin_x, self.origin_y, self.resolution)


def obstacle_distances(grid: Grid, max_dist: float) -> Field:
    """Distance to the nearest occupied cell [m], at most `max_dist`; cut to the occupied part and a margin."""
    return _distances(grid, grid.cells == OCCUPIED, max_dist, margin=True)


def blocked_distances(grid: Grid, max_dist: float) -> Field:
    """Distance to the nearest cell that is not free [m], at most `max_dist`; cut to the occupied part."""
    return _distances(grid, grid.cells == OCCUPIED, max_dist, margin=False, marked=grid.cells != 0)


def _distances(
    grid: Grid,
    occupied: NDArray[np.bool_],
    max_dist: float,
    *,
    margin: bool,
    marked: NDArray[np.bool_] | None = None,
) -> Field:
    info = grid.info
    bound = max(math.ceil(max_dist / info.resolution), 1)
    rows, columns = np.flatnonzero(occupied.any(axis=1)), np.flatnonzero(occupied.any(axis=0))
    if not len(rows):
        empty = np.full((1, 1), max_dist, dtype=np.float32)
        return Field(empty, info.origin_x, info.origin_y, info.resolution)
    pad = bound + 1 if margin else 0
    y0, y1, x0, x1 = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    part = np.pad((occupied if marked is None else marked)[y0:y1, x0:x1], pad)
    cells = bounded_distances(np.ascontiguousarray(part), bound)
    return Field(
        np.minimum(cells * np.float32(info.resolution), np.float32(max_dist)),
        info.origin_x + (x0 - pad) * info.resolution,
        info.origin_y + (y0 - pad) * info.resolution,
        info.resolution,
    )
