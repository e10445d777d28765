"""Intersection of a line segment with triangles: bounds first, then each triangle (Moeller and Trumbore 1997)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]


@kernel("boolean(float64[::1], float64[::1], float64[:, :, ::1], float64[:, :, ::1], int64[::1])")
def meets(start: Array, end: Array, bounds: Array, triangles: Array, begins: NDArray[np.int64]) -> bool:
    """Whether anything lies between two points.

    Args:
        start: one point, shape (3,) [m].
        end: the other point.
        bounds: lowest and highest x, y, z of each part, shape (P, 2, 3) [m].
        triangles: corners, shape (T, 3, 3) [m].
        begins: index of each part's first triangle, then their total number, shape (P + 1,).
    """
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    for p in range(bounds.shape[0]):
        enters, leaves = 0.0, 1.0
        for axis in range(3):
            step = end[axis] - start[axis]
            low, high = bounds[p, 0, axis] - start[axis], bounds[p, 1, axis] - start[axis]
            if step == 0.0:
                if low > 0.0 or high < 0.0:
                    leaves = -1.0
            else:
                near, far = low / step, high / step
                if near > far:
                    near, far = far, near
                enters, leaves = max(enters, near), min(leaves, far)
        if enters > leaves:
            continue
        for k in range(begins[p], begins[p + 1]):
            a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
            ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
            det = ux * px + uy * py + uz * pz
            if det == 0.0:
                continue
            sx, sy, sz = start[0] - a[0], start[1] - a[1], start[2] - a[2]
            u = (sx * px + sy * py + sz * pz) / det
            if u < 0.0 or u > 1.0:
                continue
            qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
            v = (dx * qx + dy * qy + dz * qz) / det
            if v < 0.0 or u + v > 1.0:
                continue
            t = (vx * qx + vy * qy + vz * qz) / det
            if 0.0 < t < 1.0:
                return True
    return False
