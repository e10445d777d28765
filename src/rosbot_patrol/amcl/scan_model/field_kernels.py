"""Inner loops that weigh particles by a scan: sums over a grid table, and rays on the map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Table = NDArray[np.float32]


@kernel(fastmath={"reassoc", "contract"})
def _sum_at(pose: tuple[float, float, float, float], xs: Array, ys: Array, table: Table) -> float:
    """Sum a table's values at the beams' end points, from one pose (x, y, cos, sin) in units of the table's cells."""
    height, width = table.shape
    flat = table.reshape(height * width)
    top, right = height - 1.0, width - 1.0
    x, y, c, s = pose
    total = 0.0
    for k in range(xs.shape[0]):
        column = np.int32(min(max(x + c * xs[k] - s * ys[k], 0.0), right))
        row = np.int32(min(max(y + s * xs[k] + c * ys[k], 0.0), top))
        total += flat[np.uint32(row) * np.uint32(width) + np.uint32(column)]
    return total


@kernel("void(float64[:, ::1], float64[::1], float64[::1], float32[:, ::1], float64, float64, float64, float64[::1])")
def sum_over_beams(
    poses: Array, xs: Array, ys: Array, table: Table, origin_x: float, origin_y: float, resolution: float, out: Array
) -> None:
    """Sum a table's values at the beams' end points, for each particle.

    Args:
        poses: x, y, yaw of the particles, shape (N, 3).
        xs: end points in the robot's frame [m], shape (K,).
        ys: likewise.
        table: value of each cell; its border cells also stand for everything beyond, shape (H, W).
        origin_x: lower left corner of the table [m].
        origin_y: likewise.
        resolution: edge of a cell [m].
        out: the sums, shape (N,).
    """
    for i in range(poses.shape[0]):
        x = (poses[i, 0] - origin_x) / resolution
        y = (poses[i, 1] - origin_y) / resolution
        pose = (x, y, math.cos(poses[i, 2]) / resolution, math.sin(poses[i, 2]) / resolution)
        out[i] = _sum_at(pose, xs, ys, table)


@kernel(
    "void(float64[:, ::1], float64[::1], float64[::1], float32[:, ::1], float64, float64, float64, float64, int64[::1])"
)
def count_agreement(
    poses: Array,
    xs: Array,
    ys: Array,
    distances: Table,
    origin_x: float,
    origin_y: float,
    resolution: float,
    near: float,
    out: NDArray[np.int64],
) -> None:
    """Number of particles, for each beam, that see its end closer than `near` [m] to an obstacle, shape (K,)."""
    height, width = distances.shape
    out[:] = 0
    for i in range(poses.shape[0]):
        x = (poses[i, 0] - origin_x) / resolution
        y = (poses[i, 1] - origin_y) / resolution
        c, s = math.cos(poses[i, 2]) / resolution, math.sin(poses[i, 2]) / resolution
        for k in range(xs.shape[0]):
            column = int(min(max(x + c * xs[k] - s * ys[k], 0.0), width - 1.0))
            row = int(min(max(y + s * xs[k] + c * ys[k], 0.0), height - 1.0))
            if distances[row, column] < near:
                out[k] += 1


@kernel(
    "float64(float64, float64, float64, float32[:, ::1], float64, float64, float64, float64)",
)
def cast_ray(
    x: float,
    y: float,
    angle: float,
    distances: Table,
    origin_x: float,
    origin_y: float,
    resolution: float,
    reach: float,
) -> float:
    """Length of a ray [m] from a point to the first cell of distance 0, at most `reach` (sphere tracing).

    `distances` [m] holds the distance of each cell to the nearest blocked one; beyond the grid nothing blocks.
    """
    height, width = distances.shape
    gx, gy = (x - origin_x) / resolution, (y - origin_y) / resolution
    c, s = math.cos(angle), math.sin(angle)
    length, limit = 0.0, reach / resolution
    while length < limit:
        px, py = gx + c * length, gy + s * length
        if px < 0.0 or py < 0.0 or px >= width or py >= height:
            return reach
        clear = distances[int(py), int(px)] / resolution
        if clear <= 0.0:
            return length * resolution
        length += max(clear - 1.4143, 0.25)
    return reach


@kernel(
    "void(float64[:, ::1], float64[::1], float64[::1], float64[::1], float32[:, ::1], float64, float64, float64,"
    " float64, float64[::1], float64[::1])"
)
def sum_beam_model(
    poses: Array,
    mount: Array,
    angles: Array,
    ranges: Array,
    distances: Table,
    origin_x: float,
    origin_y: float,
    resolution: float,
    reach: float,
    mixture: Array,
    out: Array,
) -> None:
    """Sum the cubed probabilities of the beam range finder model (Probabilistic Robotics, table 6.1).

    Args:
        poses: x, y, yaw of the particles, shape (N, 3).
        mount: x, y, yaw of the sensor on the robot, shape (3,).
        angles: of the beams in the sensor's frame [rad], shape (K,).
        ranges: measured, `reach` without a hit [m], shape (K,).
        distances: of each cell to the nearest blocked one [m].
        origin_x: lower left corner of the distances [m].
        origin_y: likewise.
        resolution: edge of a cell [m].
        reach: largest range of the sensor [m].
        mixture: z_hit, z_short, z_max, z_rand, sigma_hit [m], lambda_short [1/m], shape (6,).
        out: the sums, shape (N,).
    """
    z_hit, z_short, z_max, z_rand, sigma, fade = mixture
    for i in range(poses.shape[0]):
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        x = poses[i, 0] + c * mount[0] - s * mount[1]
        y = poses[i, 1] + s * mount[0] + c * mount[1]
        yaw = poses[i, 2] + mount[2]
        total = 0.0
        for k in range(angles.shape[0]):
            expected = cast_ray(x, y, yaw + angles[k], distances, origin_x, origin_y, resolution, reach)
            error = ranges[k] - expected
            p = z_hit * math.exp(-error * error / (2.0 * sigma * sigma))
            if error < 0.0:
                p += z_short * fade * math.exp(-fade * ranges[k])
            if ranges[k] >= reach:
                p += z_max
            else:
                p += z_rand / reach
            total += p * p * p
        out[i] = total
