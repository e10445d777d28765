"""Inner loops of the layers: ray tracing, marking, merging into the master, sampling a map, filling polygons."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

CLEARED = 1  # a lethal cell cleared by a ray in this update and not marked again yet


@kernel("void(int64[::1], int64, int64)")
def _touch(changes: NDArray[np.int64], x: int, y: int) -> None:
    changes[0], changes[1] = min(changes[0], x), min(changes[1], y)
    changes[2], changes[3] = max(changes[2], x + 1), max(changes[3], y + 1)


@kernel(
    "void(uint8[:, ::1], float64, float64, float64, float64, float64, float64[:, ::1], int64, int32[::1], int64[::1])"
)
def clear_rays(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    sensor_x: float,
    sensor_y: float,
    ends: NDArray[np.float64],
    reach: int,
    cleared: NDArray[np.int32],
    changes: NDArray[np.int64],
) -> None:
    """Free the cells from the sensor to each end [m], at most `reach` cells far.

    Lines are costmap_2d's: cut at the window's edge, then Bresenham's, both ends included. A lethal cell becomes
    CLEARED and is recorded, so that `settle` knows which marks are really gone.

    Args:
        cells: the layer's costs.
        resolution: edge of a cell [m].
        origin_x: left edge of the window [m].
        origin_y: lower edge [m].
        sensor_x: start of the rays [m]; outside the window nothing is cleared.
        sensor_y: the same.
        ends: shape (N, 2) [m].
        reach: [cells].
        cleared: flat indices of lethal cells that were cleared; changes[4] counts them, also those without room.
        changes: x0, y0, x1, y1 around the cells that changed, grown here, and the count.
    """
    height, width = cells.shape
    cx = math.floor((sensor_x - origin_x) / resolution)
    cy = math.floor((sensor_y - origin_y) / resolution)
    if cx < 0 or cy < 0 or cx >= width or cy >= height:
        return
    end_x, end_y = origin_x + width * resolution, origin_y + height * resolution
    for i in range(ends.shape[0]):
        wx, wy = ends[i, 0], ends[i, 1]
        a, b = wx - sensor_x, wy - sensor_y
        if wx < origin_x:
            wx, wy = origin_x, sensor_y + b * (origin_x - sensor_x) / a
        if wy < origin_y:
            wx, wy = sensor_x + a * (origin_y - sensor_y) / b, origin_y
        if wx > end_x:
            wx, wy = end_x - 0.001, sensor_y + b * (end_x - sensor_x) / a
        if wy > end_y:
            wx, wy = sensor_x + a * (end_y - sensor_y) / b, end_y - 0.001
        ex, ey = math.floor((wx - origin_x) / resolution), math.floor((wy - origin_y) / resolution)
        if ex < 0 or ey < 0 or ex >= width or ey >= height:
            continue
        dx, dy = abs(ex - cx), abs(ey - cy)
        length = math.sqrt(float(dx * dx + dy * dy))
        long, short = max(dx, dy), min(dx, dy)
        steps = long
        if length > reach:
            steps = int(reach / length * long)
        sx, sy = (1 if ex > cx else -1), (1 if ey > cy else -1)
        x, y = cx, cy
        error = long // 2
        for _ in range(steps + 1):
            old = cells[y, x]
            if old == 254:
                cells[y, x] = CLEARED
                if changes[4] < len(cleared):
                    cleared[changes[4]] = y * width + x
                changes[4] += 1
            elif old > CLEARED:
                cells[y, x] = 0
                _touch(changes, x, y)
            error += short
            turns = error >= long
            if turns:
                error -= long
            if dx >= dy:
                x += sx
                y += sy if turns else 0
            else:
                y += sy
                x += sx if turns else 0


@kernel("void(uint8[:, ::1], float64, float64, float64, float64, float64, float64[:, ::1], float64, int64[::1])")
def mark_points(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    sensor_x: float,
    sensor_y: float,
    points: NDArray[np.float64],
    obstacle_range: float,
    changes: NDArray[np.int64],
) -> None:
    """Make the cells of points [m] within `obstacle_range` of the sensor lethal; see `clear_rays`."""
    height, width = cells.shape
    reach = obstacle_range * obstacle_range
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - sensor_x, points[i, 1] - sensor_y
        if dx * dx + dy * dy >= reach:
            continue
        ix = math.floor((points[i, 0] - origin_x) / resolution)
        iy = math.floor((points[i, 1] - origin_y) / resolution)
        if ix < 0 or iy < 0 or ix >= width or iy >= height:
            continue
        old = cells[iy, ix]
        cells[iy, ix] = 254
        if old != CLEARED and old != 254:
            _touch(changes, ix, iy)


@kernel("void(uint8[:, ::1], int32[::1], int64[::1])")
def settle(cells: NDArray[np.uint8], cleared: NDArray[np.int32], changes: NDArray[np.int64]) -> None:
    """Free the cells that were cleared and not marked again; see `clear_rays`."""
    height, width = cells.shape
    if changes[4] > len(cleared):  # more than could be noted
        for y in range(height):
            for x in range(width):
                if cells[y, x] == CLEARED:
                    cells[y, x] = 0
                    _touch(changes, x, y)
    else:
        for i in range(changes[4]):
            y, x = cleared[i] // width, cleared[i] % width
            if cells[y, x] == CLEARED:
                cells[y, x] = 0
                _touch(changes, x, y)
    changes[4] = 0


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64)")
def merge_max(master: NDArray[np.uint8], layer: NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int) -> None:
    """Combine by maximum, as upstream; unknown cells of the layer are ignored, those of the master replaced."""
    for y in range(y0, y1):
        old, new = master[y, x0:x1], layer[y, x0:x1]
        for x in range(len(old)):
            was, says = old[x], new[x]
            higher = says if was == 255 else max(was, says)
            old[x] = was if says == 255 else higher


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64)")
def merge_over(master: NDArray[np.uint8], layer: NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int) -> None:
    """Combine by overwriting, as upstream: every known cell of the layer replaces the master's."""
    for y in range(y0, y1):
        old, new = master[y, x0:x1], layer[y, x0:x1]
        for x in range(len(old)):
            old[x] = old[x] if new[x] == 255 else new[x]


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64, float64[::1], boolean)")
def sample_map(
    master: NDArray[np.uint8],
    source: NDArray[np.uint8],
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    affine: NDArray[np.float64],
    use_maximum: bool,
) -> None:
    """Write a map with another place, resolution or rotation into the master.

    `affine` is (a, b, c, d, e, f): source ix = a * x + b * y + c, source iy = d * x + e * y + f, for the master's
    cells x, y.
    """
    height, width = source.shape
    a, b, c, d, e, f = affine[0], affine[1], affine[2], affine[3], affine[4], affine[5]
    is_turned = b != 0.0 or d != 0.0
    columns = np.empty(max(x1 - x0, 0), np.int64)
    for x in range(x0, x1):
        columns[x - x0] = math.floor(a * x + c)
    for y in range(y0, y1):
        row = math.floor(e * y + f)
        if not is_turned and (row < 0 or row >= height):
            continue
        for x in range(x0, x1):
            sx, sy = columns[x - x0], row
            if is_turned:
                sx, sy = math.floor(a * x + b * y + c), math.floor(d * x + e * y + f)
            if sx < 0 or sy < 0 or sx >= width or sy >= height:
                continue
            new, old = source[sy, sx], master[y, x]
            if not use_maximum or (new != 255 and (old == 255 or old < new)):
                master[y, x] = new


@kernel("void(uint8[:, ::1], float64[:, ::1], uint8, int64, int64, int64, int64, int64[::1])")
def fill_polygon(
    cells: NDArray[np.uint8],
    corners: NDArray[np.float64],
    value: int,
    left: int,
    low: int,
    right: int,
    high: int,
    changes: NDArray[np.int64],
) -> None:
    """Set the cells whose centres lie in a polygon and in a rectangle; `changes` as in `clear_rays`.

    Args:
        cells: costs.
        corners: in cells (x, y), shape (N, 2).
        value: new cost.
        left: of the rectangle [cells].
        low: its lower edge.
        right: not included.
        high: not included.
        changes: grown around the cells that had another value.
    """
    n = corners.shape[0]
    y0 = max(math.floor(corners[:, 1].min()), low)
    y1 = min(math.ceil(corners[:, 1].max()), high)
    x0 = max(math.floor(corners[:, 0].min()), left)
    x1 = min(math.ceil(corners[:, 0].max()), right)
    for y in range(y0, y1):
        py = y + 0.5
        for x in range(x0, x1):
            px = x + 0.5
            inside = False
            j = n - 1
            for i in range(n):
                if (corners[i, 1] > py) != (corners[j, 1] > py):
                    slope = (corners[j, 0] - corners[i, 0]) / (corners[j, 1] - corners[i, 1])
                    if px < corners[i, 0] + slope * (py - corners[i, 1]):
                        inside = not inside
                j = i
            if inside and cells[y, x] != value:
                cells[y, x] = value
                _touch(changes, x, y)
