"""The part of a map that is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rosbot_patrol.grid import Grid


def known_part(grid: Grid, margin: float = 0.0) -> Grid:
    """Cut a map to its known cells.

    Args:
        grid: of occupancy, -1 for unknown; may be turned.
        margin: what stays around them, within the map [m].

    Returns:
        A copy; one cell if nothing is known.
    """
    info, around = grid.info, math.ceil(margin / grid.info.resolution - 1e-6)
    rows, columns = (np.flatnonzero((grid.cells >= 0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        rows = columns = np.zeros(1, dtype=np.int64)
        around = 0
    y0, y1 = max(int(rows[0]) - around, 0), min(int(rows[-1]) + 1 + around, info.height)
    x0, x1 = max(int(columns[0]) - around, 0), min(int(columns[-1]) + 1 + around, info.width)
    c, s = math.cos(info.yaw) * info.resolution, math.sin(info.yaw) * info.resolution
    corner = {"origin_x": info.origin_x + c * x0 - s * y0, "origin_y": info.origin_y + s * x0 + c * y0}
    return Grid(replace(info, width=x1 - x0, height=y1 - y0, **corner), grid.cells[y0:y1, x0:x1].copy())
