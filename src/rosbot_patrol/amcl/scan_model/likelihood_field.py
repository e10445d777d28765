"""Distances to the nearest obstacle of the map, cropped to the part with obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.distance_kernels import bounded_distances
from rosbot_patrol.maps.occupancy import FREE, OCCUPIED, UNKNOWN

Table = NDArray[np.float32]


@dataclass(frozen=True)
class Field:
    """A table on the grid; its border cells also stand for everything beyond.

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
        """A copy with the same geometry and other values."""
        table = np.ascontiguousarray(values, dtype=np.float32)
        return Field(table, self.origin_x, self.origin_y, self.resolution)


def obstacle_distances(grid: Grid, max_dist: float) -> Field:
    """Distance to the nearest occupied cell [m], at most `max_dist`; cropped to the occupied part and a margin."""
    occupied = grid.cells == OCCUPIED
    margin = max(math.ceil(max_dist / grid.info.resolution), 1) + 1
    return _distances(grid, occupied, occupied, margin, max_dist)


def blocked_distances(grid: Grid, max_dist: float) -> Field:
    """Distance to the nearest cell that is not free [m], at most `max_dist`; cropped to the known part."""
    return _distances(grid, grid.cells != FREE, grid.cells != UNKNOWN, 0, max_dist)


def _distances(grid: Grid, marked: NDArray[np.bool_], shown: NDArray[np.bool_], margin: int, max_dist: float) -> Field:
    """Distances to the marked cells, in the smallest box around the shown ones and a margin [cells]."""
    info = grid.info
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    if not len(rows):
        empty = np.full((1, 1), max_dist, dtype=np.float32)
        return Field(empty, info.origin_x, info.origin_y, info.resolution)
    y0, y1, x0, x1 = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    part = np.pad(marked[y0:y1, x0:x1], margin)
    cells = bounded_distances(np.ascontiguousarray(part), max(math.ceil(max_dist / info.resolution), 1))
    return Field(
        np.minimum(cells * np.float32(info.resolution), np.float32(max_dist)),
        info.origin_x + (x0 - margin) * info.resolution,
        info.origin_y + (y0 - margin) * info.resolution,
        info.resolution,
    )
