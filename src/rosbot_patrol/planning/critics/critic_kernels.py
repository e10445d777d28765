"""Inner loops of the critics: the visible part of the plan, distance fields, and look-ups in them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel("float64(float32[:, ::1], float64, float64, float64, float64, float64)")
def read_field(
    field: NDArray[np.float32], resolution: float, origin_x: float, origin_y: float, x: float, y: float
) -> float:
    """Value of a field at a point, interpolated between the finite cells around; inf if there are none."""
    height, width = field.shape
    u = (x - origin_x) / resolution - 0.5
    v = (y - origin_y) / resolution - 0.5
    x0, y0 = math.floor(u), math.floor(v)
    fx, fy = u - x0, v - y0
    total, weight = 0.0, 0.0
    for k in range(4):
        jx, jy = x0 + (k & 1), y0 + (k >> 1)
        if jx < 0 or jy < 0 or jx >= width or jy >= height:
            continue
        value = float(field[jy, jx])
        if math.isfinite(value):
            w = (fx if k & 1 else 1.0 - fx) * (fy if k >> 1 else 1.0 - fy) + 1e-9
            total += w * value
            weight += w
    if weight < 1e-8:
        return np.inf
    return total / weight


@kernel("float64[:, ::1](float64[:, ::1], float32[:, ::1], float64, float64, float64, float64)")
def end_distances(
    ends: NDArray[np.float64],
    field: NDArray[np.float32],
    resolution: float,
    origin_x: float,
    origin_y: float,
    nose: float,
) -> NDArray[np.float64]:
    """Distances [cells] of poses, shape (K, 3), and of the points `nose` [m] ahead of them; shape (2, K).

    If the pose itself is unreachable, both are inf; a nose in an obstacle counts up to its edge.
    """
    out = np.empty((2, ends.shape[0]), np.float64)
    for k in range(ends.shape[0]):
        x, y, yaw = ends[k, 0], ends[k, 1], ends[k, 2]
        here = read_field(field, resolution, origin_x, origin_y, x, y)
        ahead = here
        if nose > 0.0 and math.isfinite(here):
            ahead = read_field(
                field, resolution, origin_x, origin_y, x + nose * math.cos(yaw), y + nose * math.sin(yaw)
            )
            ahead = min(ahead, here + nose / resolution)
        out[0, k], out[1, k] = here, ahead
    return out


@kernel("uint8[:, ::1](uint8[:, ::1], int64)")
def shrink(cells: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Highest cost of each block of factor x factor cells (255, unknown, included)."""
    height, width = cells.shape
    h, w = (height + factor - 1) // factor, (width + factor - 1) // factor
    out = np.zeros((h, w), np.uint8)
    column = np.empty(width, np.uint8)
    for y in range(h):
        column[:] = cells[y * factor]
        for iy in range(y * factor + 1, min((y + 1) * factor, height)):
            row = cells[iy]
            for x in range(width):
                column[x] = max(column[x], row[x])
        for x in range(w):
            highest = np.uint8(0)
            for ix in range(x * factor, min((x + 1) * factor, width)):
                highest = max(highest, column[ix])
            out[y, x] = highest
    return out


@kernel("float32[:, ::1](uint8[:, ::1], float64[:, ::1])")
def spread(cells: NDArray[np.uint8], sources: NDArray[np.float64]) -> NDArray[np.float32]:
    """Distance [cells] from the nearest source around impassable cells (253 and more); inf if there is no path.

    First-order upwind differences (Sethian 1996), relaxed in the order of a queue; a source's own cell counts as free.

    Args:
        cells: costs.
        sources: points (x, y) [cells, from the grid's corner], shape (N, 2); those outside are ignored.
    """
    height, width = cells.shape
    out = np.full((height, width), np.inf, np.float32)
    flat = out.ravel()
    queue = np.empty(height * width + 1, np.int32)
    waiting = np.zeros(height * width, np.bool_)
    first, last = 0, 0
    for i in range(sources.shape[0]):
        u, v = sources[i, 0], sources[i, 1]
        own_x, own_y = math.floor(u), math.floor(v)
        x0, y0 = math.floor(u - 0.5), math.floor(v - 0.5)
        if own_x < 0 or own_y < 0 or own_x >= width or own_y >= height:
            continue
        for k in range(4):
            ix, iy = x0 + (k & 1), y0 + (k >> 1)
            if ix < 0 or iy < 0 or ix >= width or iy >= height:
                continue
            if cells[iy, ix] >= 253 and not (ix == own_x and iy == own_y):
                continue
            cell = iy * width + ix
            off = np.float32(math.sqrt((ix + 0.5 - u) ** 2 + (iy + 0.5 - v) ** 2))
            flat[cell] = min(flat[cell], off)
            if not waiting[cell]:
                waiting[cell] = True
                queue[last] = cell
                last += 1
    far = np.float32(np.inf)
    while first != last:
        cell = queue[first]
        first = first + 1 if first < height * width else 0
        waiting[cell] = False
        cy, cx = cell // width, cell % width
        here = flat[cell]
        for k in range(4):
            nx = cx + (1 if k == 0 else (-1 if k == 1 else 0))
            ny = cy + (1 if k == 2 else (-1 if k == 3 else 0))
            if nx < 0 or ny < 0 or nx >= width or ny >= height or cells[ny, nx] >= 253:
                continue
            there = ny * width + nx
            old = flat[there]
            if old <= here:
                continue
            a = min(flat[there - 1] if nx > 0 else far, flat[there + 1] if nx + 1 < width else far)
            b = min(flat[there - width] if ny > 0 else far, flat[there + width] if ny + 1 < height else far)
            low, high = min(a, b), max(a, b)
            if high - low >= 1.0:
                t = low + np.float32(1.0)
            else:
                gap = high - low
                t = np.float32(0.5) * (low + high + np.float32(math.sqrt(np.float32(2.0) - gap * gap)))
            if t >= old - np.float32(1e-3):
                continue
            flat[there] = t
            if not waiting[there]:
                waiting[there] = True
                queue[last] = there
                last = last + 1 if last < height * width else 0
    return out


@kernel(
    "Tuple((float64[:, ::1], int64, int64))(float64[:, ::1], int64, float64[::1], float64[::1], float64[::1], boolean)"
)
def cut_plan(
    plan: NDArray[np.float64],
    passed: int,
    local_from_plan: NDArray[np.float64],
    here: NDArray[np.float64],
    window: NDArray[np.float64],
    prune: bool,
) -> tuple[NDArray[np.float64], int, int]:
    """Part of the plan in the local frame, from the robot to where it leaves the local costmap.

    Args:
        plan: poses in the plan's frame, shape (N, 3).
        passed: the first that counts.
        local_from_plan: x, y, yaw.
        here: the robot's x, y.
        window: least and greatest x and y of the local costmap.
        prune: drop the part behind the robot; else start where the plan enters the local costmap.

    Returns:
        Poses inside, shape (M, 3), empty if the nearest is outside; the index of that nearest pose, and how many of
        those returned lie before it. It is not one of a later leg that only passes by: at most 1 m farther along the
        plan than the robot is from its start.
    """
    c, s = math.cos(local_from_plan[2]), math.sin(local_from_plan[2])
    ox, oy = local_from_plan[0], local_from_plan[1]
    nearest, best = passed, np.inf
    along, limit, before_x, before_y = 0.0, np.inf, 0.0, 0.0
    for i in range(passed, plan.shape[0]):
        x = ox + c * plan[i, 0] - s * plan[i, 1]
        y = oy + s * plan[i, 0] + c * plan[i, 1]
        off = math.hypot(x - here[0], y - here[1])
        if i == passed:
            limit = 1.0 + off
        else:
            along += math.hypot(x - before_x, y - before_y)
        if along > limit:
            break
        if off < best:
            best, nearest = off, i
        before_x, before_y = x, y
    first = nearest
    while not prune and first > 0:
        x = ox + c * plan[first - 1, 0] - s * plan[first - 1, 1]
        y = oy + s * plan[first - 1, 0] + c * plan[first - 1, 1]
        if not (window[0] <= x <= window[1] and window[2] <= y <= window[3]):
            break
        first -= 1
    out = np.empty((plan.shape[0] - first, 3), np.float64)
    n = 0
    for i in range(first, plan.shape[0]):
        x = ox + c * plan[i, 0] - s * plan[i, 1]
        y = oy + s * plan[i, 0] + c * plan[i, 1]
        if not (window[0] <= x <= window[1] and window[2] <= y <= window[3]):
            break
        yaw = plan[i, 2] + local_from_plan[2]
        out[n, 0], out[n, 1] = x, y
        out[n, 2] = yaw - math.tau * math.floor((yaw + math.pi) / math.tau)
        n += 1
    return out[:n].copy(), nearest, nearest - first


@kernel("float64[::1](float64[:, ::1], float64[:, ::1], uint8[:, ::1], float64, float64, float64)")
def headings_off(
    ends: NDArray[np.float64],
    plan: NDArray[np.float64],
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
) -> NDArray[np.float64]:
    """Angle between the heading of each end and the first visible pose of the plan; pi if none is visible.

    Args:
        ends: poses, shape (K, 3).
        plan: poses, the best first, shape (N, 3).
        cells: costs; 253 and more block the view.
        resolution: edge of a cell [m].
        origin_x: their corner [m].
        origin_y: their corner [m].
    """
    height, width = cells.shape
    out = np.full(ends.shape[0], math.pi, np.float64)
    for k in range(ends.shape[0]):
        x, y = ends[k, 0], ends[k, 1]
        for i in range(plan.shape[0]):
            dx, dy = plan[i, 0] - x, plan[i, 1] - y
            length = math.hypot(dx, dy)
            count = int(length / resolution) + 1
            is_seen = True
            for j in range(count + 1):
                ix = math.floor((x + dx * j / count - origin_x) / resolution)
                iy = math.floor((y + dy * j / count - origin_y) / resolution)
                if ix < 0 or iy < 0 or ix >= width or iy >= height or cells[iy, ix] >= 253:
                    is_seen = False
                    break
            if is_seen and length > 1e-6:
                off = math.atan2(dy, dx) - ends[k, 2]
                out[k] = abs(off - math.tau * math.floor((off + math.pi) / math.tau))
                break
    return out
