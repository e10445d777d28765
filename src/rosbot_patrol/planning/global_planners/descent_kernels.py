"""Inner loops that trace a path back down a field of arrival times.

Paths descend the interpolated gradient of the field, so they are not bound to eight directions.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel("UniTuple(float64, 2)(float32[:, ::1], int64, int64)")
def slope(times: NDArray[np.float32], ix: int, iy: int) -> tuple[float, float]:
    """Gradient (uphill) at a cell's centre, upwind as in the field's computation."""
    height, width = times.shape
    here = times[iy, ix]
    left = times[iy, ix - 1] if ix > 0 else np.float32(np.inf)
    right = times[iy, ix + 1] if ix + 1 < width else np.float32(np.inf)
    down = times[iy - 1, ix] if iy > 0 else np.float32(np.inf)
    up = times[iy + 1, ix] if iy + 1 < height else np.float32(np.inf)
    gx, gy = 0.0, 0.0
    if min(left, right) < here:
        gx = float(here - left) if left < right else float(right - here)
    if min(down, up) < here:
        gy = float(here - down) if down < up else float(up - here)
    return gx, gy


@kernel("Tuple((float64[:, ::1], int64))(float32[:, ::1], float64, float64, float64, float64, float64)")
def descend(
    times: NDArray[np.float32], from_x: float, from_y: float, to_x: float, to_y: float, step: float
) -> tuple[NDArray[np.float64], int]:
    """Follow the descent of `times` from a point to (about) a source; cells have centres at whole numbers.

    Returns:
        Points (x, y), shape (N, 2), ending at (to_x, to_y); and 1 if that was reached, else 0.
    """
    height, width = times.shape
    out = np.empty((1024, 2), np.float64)
    n = 0
    x, y = from_x, from_y
    stay = 0
    reached = 0
    lowest = times[round(y), round(x)]
    for _ in range(8 * width * height + 64):
        if n == out.shape[0]:
            out = np.concatenate((out, np.empty_like(out)))
        out[n, 0], out[n, 1] = x, y
        n += 1
        ix, iy = round(x), round(y)
        if abs(x - to_x) < 1.0 and abs(y - to_y) < 1.0:
            end_x, end_y = round(to_x), round(to_y)
            if ix == end_x or iy == end_y or (math.isfinite(times[iy, end_x]) and math.isfinite(times[end_y, ix])):
                reached = 1
                break
        # gradient, interpolated between the four centres around, without unreachable ones
        x0, y0 = math.floor(x), math.floor(y)
        fx, fy = x - x0, y - y0
        gx, gy, weight = 0.0, 0.0, 0.0
        for k in range(4):
            jx, jy = x0 + (k & 1), y0 + (k >> 1)
            if jx < 0 or jy < 0 or jx >= width or jy >= height or not math.isfinite(times[jy, jx]):
                continue
            w = (fx if k & 1 else 1.0 - fx) * (fy if k >> 1 else 1.0 - fy)
            sx, sy = slope(times, jx, jy)
            norm = math.sqrt(sx * sx + sy * sy)
            if norm > 0.0:
                gx += w * sx / norm
                gy += w * sy / norm
                weight += w
        norm = math.sqrt(gx * gx + gy * gy)
        moved = False
        if norm > 1e-3 and stay < 8:
            nx, ny = x - step * gx / norm, y - step * gy / norm
            jx, jy = round(nx), round(ny)
            if 0 <= jx < width and 0 <= jy < height:
                same = jx == ix and jy == iy
                corner_free = jx == ix or jy == iy or (math.isfinite(times[iy, jx]) and math.isfinite(times[jy, ix]))
                if same or (times[jy, jx] < lowest and corner_free):
                    stay = stay + 1 if same else 0
                    x, y = nx, ny
                    lowest = times[jy, jx]
                    moved = True
        if not moved:
            best, bx, by = times[iy, ix], -1, -1
            for k in range(4):
                jx = ix + (1 if k == 0 else (-1 if k == 1 else 0))
                jy = iy + (1 if k == 2 else (-1 if k == 3 else 0))
                if 0 <= jx < width and 0 <= jy < height and times[jy, jx] < best:
                    best, bx, by = times[jy, jx], jx, jy
            if bx < 0:
                break
            x, y = float(bx), float(by)
            lowest = best
            stay = 0
    if reached:
        if n == out.shape[0]:
            out = np.concatenate((out, np.empty((1, 2))))
        out[n, 0], out[n, 1] = to_x, to_y
        n += 1
    return out[:n].copy(), reached


@kernel("Tuple((float64[:, ::1], int64))(float32[:, ::1], int64, int64, int64, int64)")
def descend_cells(
    times: NDArray[np.float32], from_x: int, from_y: int, to_x: int, to_y: int
) -> tuple[NDArray[np.float64], int]:
    """Follow the descent of `times` from cell to cell, in eight directions, never between cells without a time.

    Returns:
        Cells (x, y), shape (N, 2), and 1 if the last is (to_x, to_y), else 0.
    """
    height, width = times.shape
    out = np.empty((1024, 2), np.float64)
    n, x, y = 0, from_x, from_y
    while True:
        if n == out.shape[0]:
            out = np.concatenate((out, np.empty_like(out)))
        out[n, 0], out[n, 1] = x, y
        n += 1
        if x == to_x and y == to_y:
            return out[:n].copy(), 1
        best, bx, by = times[y, x], x, y
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                jx, jy = x + dx, y + dy
                if jx < 0 or jy < 0 or jx >= width or jy >= height or not times[jy, jx] < best:
                    continue
                if dx != 0 and dy != 0 and not (math.isfinite(times[y, jx]) and math.isfinite(times[jy, x])):
                    continue
                best, bx, by = times[jy, jx], jx, jy
        if bx == x and by == y:
            return out[:n].copy(), 0
        x, y = bx, by
