"""Inner loops of depth images: obstacles on the floor, and marks that the camera looks behind."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

_CLEARED = 1  # as in costmap_kernels


@kernel(
    "int64(float32[:, ::1], float64[::1], float64[:, ::1], float64, float64, float64, float64, float64[::1], float64,"
    "int64, int64, float64[:, :, ::1], float64[:, ::1])"
)
def standing_points(
    depth: NDArray[np.float32],
    optics: NDArray[np.float64],
    pose: NDArray[np.float64],
    nearest: float,
    farthest: float,
    low: float,
    slope: float,
    heights: NDArray[np.float64],
    edge: float,
    min_points: int,
    reach: int,
    bins: NDArray[np.float64],
    found: NDArray[np.float64],
) -> int:
    """Find obstacles on the floor that the lidar does not see.

    Points above the floor's band and below the top fall into squares around the camera. A square with enough points is
    an obstacle at their mean, unless the square or its neighbours hold points at the lidar's height.

    Args:
        depth: along the optical axis [m], shape (H, W); what is not finite or not positive is unknown.
        optics: fx, fy, cx, cy [px of this picture].
        pose: level_from_optical, shape (3, 4); level is the costmap's frame below the camera, z from the floor.
        nearest: shortest distance along the floor [m].
        farthest: longest [m].
        low: the floor's band at the camera [m].
        slope: growth of that band per metre.
        heights: top [m], and lowest and highest point at the lidar's height [m].
        edge: of a square [m].
        min_points: that make a place.
        reach: squares around one at the lidar's height that are left to the lidar.
        bins: scratch, shape (N, N, 4): count, sums of x and y, lidar's; zero, and zero again on return.
        found: the places (x, y) in the level frame [m], shape (M, 2).

    Returns:
        How many were found; no more than there is room for.
    """
    height, width = depth.shape
    fx, fy, cx, cy = optics[0], optics[1], optics[2], optics[3]
    top, lidar_low, lidar_high = heights[0], heights[1], heights[2]
    size = bins.shape[0]
    half = size // 2
    x_min, x_max, y_min, y_max = size, -1, size, -1
    for v in range(height):
        b = (v - cy) / fy
        rx = pose[0, 1] * b + pose[0, 2]
        ry = pose[1, 1] * b + pose[1, 2]
        rz = pose[2, 1] * b + pose[2, 2]
        for u in range(width):
            d = np.float64(depth[v, u])
            if not (d > 0.0 and d < 1e3):
                continue
            a = (u - cx) / fx
            z = d * (pose[2, 0] * a + rz) + pose[2, 3]
            if z < low or z > top:
                continue
            x = d * (pose[0, 0] * a + rx)
            y = d * (pose[1, 0] * a + ry)
            distance = math.sqrt(x * x + y * y)
            if distance < nearest or distance >= farthest or z < low + slope * distance:
                continue
            ix, iy = math.floor(x / edge) + half, math.floor(y / edge) + half
            if ix < 0 or iy < 0 or ix >= size or iy >= size:
                continue
            cell = bins[iy, ix]
            cell[0] += 1.0
            cell[1] += x
            cell[2] += y
            if lidar_low <= z <= lidar_high:
                cell[3] = 1.0
            x_min, x_max = min(x_min, ix), max(x_max, ix)
            y_min, y_max = min(y_min, iy), max(y_max, iy)
    count = 0
    for iy in range(y_min, y_max + 1):
        for ix in range(x_min, x_max + 1):
            n = bins[iy, ix, 0]
            if n < min_points or count >= found.shape[0]:
                continue
            seen = False
            for jy in range(max(iy - reach, 0), min(iy + reach, size - 1) + 1):
                for jx in range(max(ix - reach, 0), min(ix + reach, size - 1) + 1):
                    seen |= bins[jy, jx, 3] > 0.0
            if not seen:
                found[count, 0], found[count, 1] = bins[iy, ix, 1] / n, bins[iy, ix, 2] / n
                count += 1
    for iy in range(y_min, y_max + 1):
        for ix in range(x_min, x_max + 1):
            bins[iy, ix, :] = 0.0
    return count


@kernel(
    "void(uint8[:, ::1], float64, float64, float64, float32[:, ::1], float64[::1], float64[:, ::1], float64, float64,"
    "float64, float64, float64, float64, int32[::1], int64[::1])"
)
def clear_looked_behind(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    depth: NDArray[np.float32],
    optics: NDArray[np.float64],
    pose: NDArray[np.float64],
    nearest: float,
    farthest: float,
    low: float,
    slope: float,
    top: float,
    step: float,
    cleared: NDArray[np.int32],
    changes: NDArray[np.int64],
) -> None:
    """Free the marks that the camera looks behind, from the floor's band to the top.

    The ray to each point above a marked cell's centre, from the floor's band to the top, must continue behind it. If
    the lowest point is outside the image, or something hides one of the points, the mark stays. Above the lowest point,
    no depth (nothing in the camera's range) counts as a far one. A mark becomes CLEARED and is recorded, as in
    `costmap_kernels.clear_rays`.

    Args:
        cells: the layer's costs.
        resolution: edge of a cell [m].
        origin_x: left edge of the window [m].
        origin_y: lower edge [m].
        depth: along the optical axis [m], shape (H, W).
        optics: fx, fy, cx, cy [px of this picture].
        pose: floor_from_optical, shape (3, 4): the costmap's frame, z from the floor.
        nearest: cells nearer to the camera stay [m].
        farthest: cells farther away stay [m].
        low: the floor's band at the camera [m].
        slope: what it grows by for each metre.
        top: highest point that counts [m].
        step: between the points [m].
        cleared: see `costmap_kernels.clear_rays`.
        changes: the same.
    """
    rows, columns = cells.shape
    height, width = depth.shape
    sx, sy, sz = pose[0, 3], pose[1, 3], pose[2, 3]
    x0 = max(math.floor((sx - farthest - origin_x) / resolution), 0)
    x1 = min(math.floor((sx + farthest - origin_x) / resolution) + 1, columns)
    y0 = max(math.floor((sy - farthest - origin_y) / resolution), 0)
    y1 = min(math.floor((sy + farthest - origin_y) / resolution) + 1, rows)
    margin = 0.75 * resolution
    for iy in range(y0, y1):
        for ix in range(x0, x1):
            if cells[iy, ix] != 254:
                continue
            dx = origin_x + (ix + 0.5) * resolution - sx
            dy = origin_y + (iy + 0.5) * resolution - sy
            distance = math.sqrt(dx * dx + dy * dy)
            if distance < nearest or distance > farthest:
                continue
            base = low + slope * distance
            steps = max(math.ceil((top - base) / step), 1)
            free = True
            for k in range(steps + 1):
                dz = min(base + k * step, top) - sz
                oz = pose[0, 2] * dx + pose[1, 2] * dy + pose[2, 2] * dz
                if oz < 0.05:
                    free = False
                    break
                u = optics[0] * (pose[0, 0] * dx + pose[1, 0] * dy + pose[2, 0] * dz) / oz + optics[2]
                v = optics[1] * (pose[0, 1] * dx + pose[1, 1] * dy + pose[2, 1] * dz) / oz + optics[3]
                iu, iv = math.floor(u + 0.5), math.floor(v + 0.5)
                if iu < 0 or iu >= width or iv >= height or (k == 0 and iv < 0):
                    free = False
                    break
                if iv < 0:  # the rest is above the picture
                    break
                d = np.float64(depth[iv, iu])
                known = d > 0.0 and d < 1e3
                if (known and d < oz + margin) or (k == 0 and not known):
                    free = False
                    break
            if free:
                cells[iy, ix] = _CLEARED
                if changes[4] < len(cleared):
                    cleared[changes[4]] = iy * columns + ix
                changes[4] += 1
