"""Inner loops of loops: the exact pose of points on a map, and how much of them the map knows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.gmapping.cholesky_kernels import factorise, solve
from rosbot_patrol.gmapping.match_kernels import DONE, DONE_TURN, FREE_RATIO, add_beams, nearest_wall
from rosbot_patrol.gmapping.tile_kernels import BITS, MASK, VISITS
from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Table = NDArray[np.int32]
Cells = NDArray[np.uint16]


@kernel()
def _is_known(table: Table, cells: Cells, x: int, y: int) -> bool:
    """Whether any beam came into a cell."""
    ty, tx = y >> BITS, x >> BITS
    if ty < 0 or tx < 0 or ty >= table.shape[0] or tx >= table.shape[1] or table[ty, tx] < 0:
        return False
    return bool(cells[table[ty, tx], ((y & MASK) << BITS) + (x & MASK), VISITS] > 0)


@kernel("void(int32[:, ::1], uint16[:, :, ::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1])")
def refine_alone(table: Table, cells: Cells, pose: Array, beams: Array, tuning: Array, information: Array) -> None:
    """Gauss-Newton on the distances of beams from the walls, with a weak prior that keeps a corridor solvable.

    Args:
        table: of the map.
        cells: likewise.
        pose: x, y [cells], yaw; changed in place, shape (3,).
        beams: see `match_particles`, shape (K, 6).
        tuning: rounds, reach [cells], share of a beam without a line, the prior's information per beam
            [1/cells2, 1/cells2, 1/rad2], shape (6,).
        information: filled with the information of the beams at the end, for a variance of 1 [cells2], shape (3, 3).
    """
    lower, slope, solved = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for _ in range(int(tuning[0])):
        information[:] = 0.0
        slope[:] = 0.0
        add_beams(table, cells, pose, beams, 1, int(tuning[1]), 1.0, tuning[2], information, slope)
        solved[:] = information
        for i in range(3):
            solved[i, i] += tuning[3 + i] * beams.shape[0]
        factorise(solved, lower)
        solve(lower, slope)
        way = math.hypot(slope[0], slope[1])
        shrink = min(1.0, 1.0 / max(way, 1e-9), 0.02 / max(abs(slope[2]), 1e-9))
        for i in range(3):
            pose[i] -= shrink * slope[i]
        if way < DONE and abs(slope[2]) < DONE_TURN:
            break


@kernel("void(int32[:, ::1], uint16[:, :, ::1], float64[::1], float64[:, ::1], float64, float64[::1])")
def count_fits(table: Table, cells: Cells, pose: Array, beams: Array, near: float, counts: Array) -> None:
    """Count the ends of beams that the map knows, that fit, and the sum of the fitting ones' squared distances.

    Args:
        table: of the map.
        cells: likewise.
        pose: x, y [cells], yaw, shape (3,).
        beams: see `match_particles`, shape (K, 6).
        near: distance from a wall up to which an end fits [cells].
        counts: filled with the number of ends in known cells, the number of fitting ends, and the sum of their squared
            distances across the walls [cells2], shape (3,).
    """
    counts[:] = 0.0
    reach = math.ceil(near)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(beams.shape[0]):
        bx, by, ux, uy = beams[k, 0], beams[k, 1], -FREE_RATIO * beams[k, 2], -FREE_RATIO * beams[k, 3]
        x, y = pose[0] + c * bx - s * by, pose[1] + s * bx + c * by
        d2, dx, dy = nearest_wall(table, cells, x, y, c * ux - s * uy, s * ux + c * uy, reach)
        if 0.0 <= d2 <= near * near:
            nx, ny = c * beams[k, 4] - s * beams[k, 5], s * beams[k, 4] + c * beams[k, 5]
            across = nx * dx + ny * dy
            counts[0] += 1.0
            counts[1] += 1.0
            counts[2] += across * across if nx != 0.0 or ny != 0.0 else d2
        elif _is_known(table, cells, math.floor(x), math.floor(y)):
            counts[0] += 1.0
