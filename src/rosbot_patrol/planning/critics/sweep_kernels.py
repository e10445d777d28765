"""Inner loops of the local planners: clearances, and simulated motion with a check of the swept footprint."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

SLACK = 1.42  # a point and a cell that touch lie at most this far from the centres of their cells, together [cells]


@kernel("float32[:, ::1](uint8[:, ::1], int64, int64, int64, int64, int64)")
def clearances(cells: NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int, cap: int) -> NDArray[np.float32]:
    """Distance from each cell of [y0:y1, x0:x1] to the nearest lethal or unknown cell in it, or beyond the grid's edge.

    Exact between centres of cells [cells], bounded by `cap` (two passes: Meijster, Roerdink, Hesselink 2000).
    """
    height, width = cells.shape
    w, h = x1 - x0, y1 - y0
    far = np.int32(cap)
    column = np.empty((h, w), np.int32)
    for x in range(w):
        column[0, x] = 0 if cells[y0, x0 + x] >= 254 else min(far, y0 + 1)
    for y in range(1, h):
        for x in range(w):
            column[y, x] = 0 if cells[y0 + y, x0 + x] >= 254 else min(column[y - 1, x] + 1, far)
    for x in range(w):
        column[h - 1, x] = min(column[h - 1, x], height - y1 + 1)
    for y in range(h - 2, -1, -1):
        for x in range(w):
            column[y, x] = min(column[y, x], column[y + 1, x] + 1)
    out = np.empty((h, w), np.float32)
    site = np.empty(w, np.int32)
    start = np.empty(w, np.int32)
    for y in range(h):
        row = column[y]
        n = 0
        for u in range(w):
            g = row[u]
            if g >= far:
                continue
            begin = 0
            while n > 0:
                v = site[n - 1]
                begin = (u * u - v * v + g * g - row[v] * row[v]) // (2 * (u - v)) + 1
                if begin > start[n - 1]:
                    break
                n -= 1
            if n == 0:
                begin = 0
            if begin < w:
                site[n], start[n] = u, max(begin, 0)
                n += 1
        for i in range(n):
            v = site[i]
            g2 = float(row[v] * row[v])
            end = start[i + 1] if i + 1 < n else w
            for u in range(start[i], end):
                out[y, u] = min(math.sqrt(float((u - v) * (u - v)) + g2), float(far))
        if n == 0:
            out[y, :] = far
        for u in range(w):
            out[y, u] = min(out[y, u], float(min(x0 + u + 1, width - x0 - u)))
    return out


@kernel(
    "float64(float32[:, ::1], float64, float64, float64, float64[:, ::1], float64, float64, float64, float64, float64, "
    "float64)"
)
def footprint_clearance(
    near: NDArray[np.float32],
    left: float,
    low: float,
    resolution: float,
    outline: NDArray[np.float64],
    spacing: float,
    reach: float,
    scale: float,
    x: float,
    y: float,
    yaw: float,
) -> float:
    """Distance that the robot at a pose can move at least before it touches anything [cells]; -1: it touches.

    Args:
        near: `clearances` of a window.
        left: the window's corner in x [m].
        low: and in y [m].
        resolution: edge of a cell [m].
        outline: points along the footprint in the robot's frame [m], shape (M, 2), at most `spacing` apart.
        spacing: see there [m].
        reach: the farthest of them from the centre [m].
        scale: enlarges the footprint.
        x: of the pose [m].
        y: of the pose [m].
        yaw: of the pose [rad].
    """
    height, width = near.shape
    jx, jy = math.floor((x - left) / resolution), math.floor((y - low) / resolution)
    if jx < 0 or jy < 0 or jx >= width or jy >= height:
        return -1.0
    free: float = near[jy, jx] - SLACK - scale * reach / resolution
    if free > 0.0:
        return free
    c, s = math.cos(yaw) * scale / resolution, math.sin(yaw) * scale / resolution
    u, v = (x - left) / resolution, (y - low) / resolution
    gap = scale * spacing / resolution
    least = 1e9
    k = 0
    while k < outline.shape[0]:
        jx = math.floor(u + c * outline[k, 0] - s * outline[k, 1])
        jy = math.floor(v + s * outline[k, 0] + c * outline[k, 1])
        if jx < 0 or jy < 0 or jx >= width or jy >= height:
            return -1.0
        free = near[jy, jx] - SLACK
        if free < SLACK and near[jy, jx] == 0.0:
            return -1.0
        # points half that far along the outline are free as well, and half of it is left for them
        skip = int(0.5 * free / gap) if free > 0.0 else 0
        least = min(least, free - skip * gap)
        k += 1 + skip
    return max(least, 0.0)


@kernel("int64(uint8[:, ::1], float64, float64, float64, float64[:, ::1], float64, float64, float64)")
def count_touching(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    outline: NDArray[np.float64],
    x: float,
    y: float,
    yaw: float,
) -> int:
    """Number of outline points in lethal cells with the robot at a pose."""
    height, width = cells.shape
    c, s = math.cos(yaw), math.sin(yaw)
    count = 0
    for k in range(outline.shape[0]):
        px = x + c * outline[k, 0] - s * outline[k, 1]
        py = y + s * outline[k, 0] + c * outline[k, 1]
        jx, jy = math.floor((px - origin_x) / resolution), math.floor((py - origin_y) / resolution)
        if 0 <= jx < width and 0 <= jy < height and cells[jy, jx] == 254:
            count += 1
    return count


@kernel("int64(float64[:, ::1], int64, float64[::1])")
def count_steps(samples: NDArray[np.float64], k: int, motion: NDArray[np.float64]) -> int:
    """Number of steps of sample k: none longer than the granularities [m], [rad]; at least four."""
    straight = math.sqrt(samples[k, 0] ** 2 + samples[k, 1] ** 2) * motion[0] / motion[2]
    steps: int = max(4, math.ceil(max(straight, abs(samples[k, 2]) * motion[0] / motion[3])))
    return steps


@kernel("UniTuple(float64, 6)(float64[::1], float64[:, ::1], int64, float64, float64[::1])")
def advance(
    state: NDArray[np.float64], samples: NDArray[np.float64], k: int, dt: float, motion: NDArray[np.float64]
) -> tuple[float, float, float, float, float, float]:
    """State (x, y, yaw, vx, vy, wz) after dt [s], accelerating towards sample k."""
    x, y, yaw = state[0], state[1], state[2]
    vx = state[3] + min(max(samples[k, 0] - state[3], -motion[4] * dt), motion[4] * dt)
    vy = state[4] + min(max(samples[k, 1] - state[4], -motion[5] * dt), motion[5] * dt)
    wz = state[5] + min(max(samples[k, 2] - state[5], -motion[6] * dt), motion[6] * dt)
    middle = yaw + wz * dt / 2.0
    c, s = math.cos(middle), math.sin(middle)
    return x + (vx * c - vy * s) * dt, y + (vx * s + vy * c) * dt, yaw + wz * dt, vx, vy, wz


@kernel("float64[:, ::1](float64[::1], float64[:, ::1], int64, float64[::1])")
def trace(
    start: NDArray[np.float64], samples: NDArray[np.float64], k: int, motion: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Poses after each step of sample k, shape (steps, 3); arguments as of `drive`."""
    steps = count_steps(samples, k, motion)
    out = np.empty((steps, 3), np.float64)
    state = start.copy()
    if motion[13] > 0.0:
        state[3:] = samples[k]
    for i in range(steps):
        state[0], state[1], state[2], state[3], state[4], state[5] = advance(
            state, samples, k, motion[0] / steps, motion
        )
        out[i] = state[:3]
    return out


@kernel(
    "void(float64[::1], float64[:, ::1], float64[::1], uint8[:, ::1], float64[::1], float32[:, ::1], int64, int64, "
    "int64, int64, float64[:, ::1], float64[:, ::1], float64[::1])"
)
def drive(
    start: NDArray[np.float64],
    samples: NDArray[np.float64],
    motion: NDArray[np.float64],
    cells: NDArray[np.uint8],
    place: NDArray[np.float64],
    near: NDArray[np.float32],
    near_x: int,
    near_y: int,
    taken_from: int,
    touching: int,
    outline: NDArray[np.float64],
    ends: NDArray[np.float64],
    worst: NDArray[np.float64],
) -> None:
    """Simulate each sample until it hits something.

    Between two steps the outline is checked as often as it may have moved by its clearance, or by a cell.

    Args:
        start: pose and velocity (x, y, yaw, vx, vy, wz).
        samples: velocities (vx, vy, wz), shape (K, 3).
        motion: horizon [s], time of `ends` [s], granularity [m], angular granularity [rad], accelerations in x, y,
            theta, what is added to the time for braking [s], reach and spacing of the outline [m]; speed from which
            the footprint grows [m/s], by how much, at which speed; 1 if a sample is had at once, else 0.
        cells: costs.
        place: resolution, origin_x, origin_y of the cells [m].
        near: `clearances` of a window that holds all that the outline can reach.
        near_x: the window's first column.
        near_y: its first row.
        taken_from: a centre that costs this or more is a collision.
        touching: points of the outline that touch something at the start; if any, a sample has to end with fewer.
        outline: see `footprint_clearance`.
        ends: is set to the pose at the time given, shape (K, 3).
        worst: samples below 0 are left out; is set to the highest cost of the centre (while touching: to the points
            that touch at the end), or to -1 where it hits something, is unknown or off the grid. Shape (K,).
    """
    height, width = cells.shape
    resolution, origin_x, origin_y = place[0], place[1], place[2]
    left, low = origin_x + near_x * resolution, origin_y + near_y * resolution
    reach, spacing = motion[8], motion[9]
    state = np.empty(6, np.float64)
    plain = 0.0
    if touching == 0:
        plain = footprint_clearance(
            near, left, low, resolution, outline, spacing, reach, 1.0, start[0], start[1], start[2]
        )
    for k in range(samples.shape[0]):
        if worst[k] < 0.0:
            continue
        speed = math.sqrt(samples[k, 0] ** 2 + samples[k, 1] ** 2)
        scale = 1.0
        if speed > motion[10] and motion[12] > motion[10]:
            scale += motion[11] * min(1.0, (speed - motion[10]) / (motion[12] - motion[10]))
        steps = count_steps(samples, k, motion)
        dt = motion[0] / steps
        # a velocity is admissible if the robot can stop before it hits something (Fox, Burgard, Thrun 1997)
        braking = 0.0
        for i in range(3):
            if motion[4 + i] > 1e-3:
                braking = max(braking, abs(samples[k, i]) / (2.0 * motion[4 + i]))
        looked_at = max(steps, math.ceil((braking + motion[7]) / dt))
        state[:] = start
        if motion[13] > 0.0:
            state[3:] = samples[k]
        budget = plain if scale == 1.0 else 0.0
        highest = 0.0
        if motion[1] <= 0.0:
            ends[k] = state[:3]
        for i in range(looked_at):
            x, y, yaw = state[0], state[1], state[2]
            state[0], state[1], state[2], state[3], state[4], state[5] = advance(state, samples, k, dt, motion)
            ix = math.floor((state[0] - origin_x) / resolution)
            iy = math.floor((state[1] - origin_y) / resolution)
            if ix < 0 or iy < 0 or ix >= width or iy >= height:
                highest = -1.0
                break
            if touching > 0:
                count = count_touching(cells, resolution, origin_x, origin_y, outline, state[0], state[1], state[2])
                highest = float(count)
                if count > touching or cells[iy, ix] >= 254:
                    highest = -1.0
                    break
            else:
                cost = cells[iy, ix]
                if cost >= taken_from:
                    highest = -1.0
                    break
                highest = max(highest, float(cost))
                turned = abs(state[2] - yaw) * reach * scale
                moved = (math.sqrt((state[0] - x) ** 2 + (state[1] - y) ** 2) + turned) / resolution
                safe = budget
                while safe < moved:
                    at = min(max(safe, 0.0) + 1.0, moved)
                    f = at / moved if moved > 0.0 else 0.0
                    free = footprint_clearance(
                        near,
                        left,
                        low,
                        resolution,
                        outline,
                        spacing,
                        reach,
                        scale,
                        x + f * (state[0] - x),
                        y + f * (state[1] - y),
                        yaw + f * (state[2] - yaw),
                    )
                    if free < 0.0:
                        highest = -1.0
                        break
                    safe = at + free
                if highest < 0.0:
                    break
                budget = safe - moved
            time = (i + 1) * dt
            if time - dt < motion[1] - 1e-9 and time >= motion[1] - 1e-9:
                ends[k] = state[:3]
        if touching > 0 and highest >= touching:
            highest = -1.0
        worst[k] = highest
