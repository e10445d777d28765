"""Grids over the plane: conversion between world and cell, and the record of a grid's place.

Cells are `cells[iy, ix]`; row 0 is the lowest y. A grid's own axes may be turned against the frame by `yaw`, but
most users require 0 (`GridInfo.require_aligned`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import MapError

RESOLUTIONS = 0.001, 100.0  # [m] smallest and largest edge of a cell; anything else is another unit or no number


@dataclass(frozen=True, kw_only=True)
class GridInfo:
    """Place and size of a grid: edge of a cell [m], cells in x and y, lower left corner [m] and turn [rad]."""

    resolution: float
    width: int
    height: int
    origin_x: float = 0.0
    origin_y: float = 0.0
    yaw: float = 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width), the shape of the cells."""
        return self.height, self.width

    @property
    def size(self) -> tuple[float, float]:
        """Extent in x and y [m]."""
        return self.width * self.resolution, self.height * self.resolution

    def require_aligned(self, who: str) -> None:
        """Raise MapError if the grid is turned; `who` names the user that cannot handle it."""
        if abs(math.remainder(self.yaw, math.tau)) > 1e-6:
            raise MapError(who, f"a map turned by {self.yaw:.3f} rad is not supported, expected a yaw of 0")

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """(ix, iy) of a point; may lie outside (see `contains_cell`)."""
        return (
            math.floor((x - self.origin_x) / self.resolution),
            math.floor((y - self.origin_y) / self.resolution),
        )

    def cell_of_clamped(self, x: float, y: float) -> tuple[int, int]:
        """(ix, iy) of a point, or of the nearest cell inside."""
        ix, iy = self.cell_of(x, y)
        return min(max(ix, 0), self.width - 1), min(max(iy, 0), self.height - 1)

    def contains_cell(self, ix: int, iy: int) -> bool:
        """Whether a cell lies in the grid."""
        return 0 <= ix < self.width and 0 <= iy < self.height

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies in the grid."""
        return self.contains_cell(*self.cell_of(x, y))

    def centre_of(self, ix: int, iy: int) -> tuple[float, float]:
        """Centre of a cell [m]."""
        return (
            self.origin_x + (ix + 0.5) * self.resolution,
            self.origin_y + (iy + 0.5) * self.resolution,
        )

    def moved_to(self, origin_x: float, origin_y: float) -> GridInfo:
        """The same grid with another lower left corner."""
        return replace(self, origin_x=origin_x, origin_y=origin_y)


@dataclass(frozen=True)
class Grid:
    """A grid and its cells, shape (height, width)."""

    info: GridInfo
    cells: NDArray[Any]

    def __post_init__(self) -> None:
        if self.cells.shape != self.info.shape:
            raise MapError("grid", f"has cells of shape {self.cells.shape}, expected {self.info.shape}")

    def at(self, x: float, y: float) -> Any:
        """Value of the cell at a point; IndexError outside."""
        ix, iy = self.info.cell_of(x, y)
        if not self.info.contains_cell(ix, iy):
            raise IndexError(f"({x:.2f}, {y:.2f}) is outside the grid")
        return self.cells[iy, ix]


def occupancy_grid(info: GridInfo, data: Any, source: str) -> Grid:
    """Make an occupancy grid of int8 cells (-1 unknown, 0 to 100) from a flat list of cells.

    Args:
        info: its place and size.
        data: the cells, lowest row first.
        source: topic or file, for the error.

    Raises:
        MapError: cells, size or resolution make no sense.
    """
    width, height, edge = info.width, info.height, info.resolution
    if width < 1 or height < 1:
        raise MapError(source, f"has {width} x {height} cells, expected at least one")
    if not RESOLUTIONS[0] <= edge <= RESOLUTIONS[1]:
        raise MapError(source, f"has cells of {edge:g} m, expected {RESOLUTIONS[0]:g} to {RESOLUTIONS[1]:g} m")
    cells = np.array(data, dtype=np.int8)
    if cells.size != width * height:
        raise MapError(source, f"has {cells.size} cells, expected {width} x {height}")
    return Grid(info, cells.reshape(info.shape))


def cells_of_points(info: GridInfo, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """(ix, iy) of points of shape (N, 2), shape (N, 2); may lie outside."""
    origin = np.array([info.origin_x, info.origin_y])
    cells: NDArray[np.int64] = np.floor((points - origin) / info.resolution).astype(np.int64)
    return cells
