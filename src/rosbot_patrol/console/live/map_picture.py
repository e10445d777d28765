"""The map as a picture, and places on it."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rosbot_patrol.console.live.house_state import SeenFloor
from rosbot_patrol.grid import Grid

_MARGIN = 0.5  # [m] around what is known
_FREE, _WALL, _UNKNOWN = (244, 246, 248, 255), (52, 60, 72, 255), (0, 0, 0, 0)
_SEEN = (46, 125, 50, 70)
_LARGEST = 4000  # [px] of the picture's longer side


@dataclass(frozen=True, kw_only=True)
class MapPicture:
    """The known part of a map.

    Attributes:
        png: the picture; unknown cells are transparent.
        width, height: of it [px].
        resolution: [m] of a pixel.
        left, top: x and y in map [m] of its upper left corner.
        number: unique among the maps of this run.
    """

    png: bytes
    width: int
    height: int
    resolution: float
    left: float
    top: float
    number: int

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Column and row of a place in map [m]."""
        return (x - self.left) / self.resolution, (self.top - y) / self.resolution

    def place(self, column: float, row: float) -> tuple[float, float]:
        """Place in map [m] of a column and row."""
        return self.left + column * self.resolution, self.top - row * self.resolution


def draw_seen(grid: Grid) -> SeenFloor | None:
    """Draw the floor that was seen, the cells above 0; None for none."""
    rows, columns = np.nonzero(grid.cells > 0)
    if len(rows) == 0:
        return None
    first, last, left, right = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
    part = grid.cells[first:last, left:right][::-1] > 0
    colours = np.zeros((*part.shape, 4), np.uint8)
    colours[part] = _SEEN
    written = io.BytesIO()
    Image.fromarray(colours, "RGBA").save(written, "PNG")
    x, y, edge = grid.info.origin_x, grid.info.origin_y, grid.info.resolution
    return SeenFloor(
        png=base64.b64encode(written.getvalue()).decode("ascii"),
        left=x + float(left) * edge,
        bottom=y + float(first) * edge,
        right=x + float(right) * edge,
        top=y + float(last) * edge,
    )


def draw_map(grid: Grid, number: int) -> MapPicture:
    """Draw what a map knows: occupied at 65 or more, free below, as in map_server's files."""
    cells: NDArray[np.int8] = grid.cells
    rows, columns = np.nonzero(cells >= 0)
    resolution = grid.info.resolution
    margin = round(_MARGIN / resolution)
    if len(rows) == 0:
        rows, columns = np.array([0, cells.shape[0] - 1]), np.array([0, cells.shape[1] - 1])
    first, last = max(rows.min() - margin, 0), min(rows.max() + margin + 1, cells.shape[0])
    left, right = max(columns.min() - margin, 0), min(columns.max() + margin + 1, cells.shape[1])
    part = cells[first:last, left:right][::-1]  # row 0 at the top
    colours = np.empty((*part.shape, 4), np.uint8)
    colours[:] = _FREE
    colours[part >= 65] = _WALL
    colours[part < 0] = _UNKNOWN
    step = max(-(-max(part.shape) // _LARGEST), 1)
    image = Image.fromarray(np.ascontiguousarray(colours[::step, ::step]), "RGBA")
    written = io.BytesIO()
    image.save(written, "PNG", optimize=False)
    return MapPicture(
        png=written.getvalue(),
        width=image.width,
        height=image.height,
        resolution=resolution * step,
        left=grid.info.origin_x + left * resolution,
        top=grid.info.origin_y + last * resolution,
        number=number,
    )
