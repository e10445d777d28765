"""Inner loop that classifies a scan's beams at one pose: explained by the map, short, through a wall, no return."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.scan_model.field_kernels import cast_ray
from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Table = NDArray[np.float32]

EXPLAINED, SHORT, THROUGH, UNRETURNED, SILENT = 0, 1, 2, 3, 4


@kernel(
    "void(float64[::1], float64[::1], float64[::1], float32[:, ::1], float64, float64, float64, float64, float64,"
    " int64[::1])"
)
def count_beams(
    sensor: Array,
    angles: Array,
    ranges: Array,
    distances: Table,
    origin_x: float,
    origin_y: float,
    resolution: float,
    reach: float,
    near: float,
    out: NDArray[np.int64],
) -> None:
    """Count the beams of each class, seen from one pose.

    Args:
        sensor: x, y, yaw of the sensor on the map, shape (3,).
        angles: of the beams in the sensor's frame [rad], shape (K,).
        ranges: measured, `reach` or more without a hit [m], shape (K,).
        distances: of each cell to the nearest obstacle [m], shape (H, W).
        origin_x: lower left corner of the distances [m].
        origin_y: likewise.
        resolution: edge of a cell [m].
        reach: largest range of the sensor [m].
        near: largest distance from an obstacle at which a beam's end is explained [m].
        out: numbers of beams that are explained, end early, went through a wall, have no hit although the map has a
            wall, have no hit and no wall, shape (5,).
    """
    height, width = distances.shape
    out[:] = 0
    for k in range(angles.shape[0]):
        angle = sensor[2] + angles[k]
        expected = cast_ray(sensor[0], sensor[1], angle, distances, origin_x, origin_y, resolution, reach)
        if ranges[k] >= reach:
            out[UNRETURNED if expected < reach - near else SILENT] += 1
            continue
        x = (sensor[0] + ranges[k] * math.cos(angle) - origin_x) / resolution
        y = (sensor[1] + ranges[k] * math.sin(angle) - origin_y) / resolution
        is_inside = 0.0 <= x < width and 0.0 <= y < height
        if abs(ranges[k] - expected) <= near or (is_inside and distances[int(y), int(x)] <= near):
            out[EXPLAINED] += 1
        elif ranges[k] < expected:
            out[SHORT] += 1
        else:
            out[THROUGH] += 1
