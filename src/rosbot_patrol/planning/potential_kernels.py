"""Arrival times over a cost grid, and the way back down.

The field solves |grad T| = cost (the Eikonal equation; Sethian 1996) with first-order upwind differences, by a
label-correcting queue of buckets (Yatziv, Bartesaghi, Sapiro 2006), ordered by T + heuristic (A*) where a target is
given. Paths descend its interpolated gradient, so they are not bound to eight directions.
"""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.kernels import kernel

BUCKETS = 256


@kernel(
    "int64(uint8[:, ::1], float32[::1], int64[:, ::1], float32[::1], int64, int64, float64, float32[:, ::1])",
)
def propagate(costs, table, sources, source_times, target_x, target_y, heuristic, times):
    """Fill `times` from the sources until the target is settled, or everywhere where `target_x` is negative.

    Args:
        costs: cost of each cell.
        table: cost of crossing a cell by its cost, inf where it cannot be crossed; shape (256,).
        sources: cells (ix, iy) to start from, shape (N, 2).
        source_times: their times, shape (N,).
        target_x: cell to reach, column.
        target_y: its row.
        heuristic: least cost of a cell, 0 for no guidance.
        times: to be filled, inf everywhere at call; shape of `costs`.

    Returns:
        1 if the target was settled (or there was none), else 0.
    """
    height, width = costs.shape
    largest = np.float32(0.0)
    smallest = np.float32(np.inf)
    for i in range(256):
        if math.isfinite(table[i]):
            largest = max(largest, table[i])
            smallest = min(smallest, table[i])
    span = max(float(smallest) * 0.5, (2.0 * float(largest) + heuristic + 1.0) * 2.0 / (BUCKETS - 4))
    head = np.full(BUCKETS, -1, np.int64)
    node = np.empty(4096, np.int64)
    link = np.empty(4096, np.int64)
    key = np.empty(4096, np.float32)
    free, used, queued = np.int64(-1), np.int64(0), np.int64(0)
    guided = target_x >= 0 and heuristic > 0.0
    level = np.int64(-1)
    for i in range(sources.shape[0]):
        ix, iy = sources[i, 0], sources[i, 1]
        t = source_times[i]
        if t < times[iy, ix]:
            times[iy, ix] = t
            f = float(t)
            if guided:
                f += heuristic * math.sqrt(float((ix - target_x) ** 2 + (iy - target_y) ** 2))
            b = np.int64(f / span)
            if level < 0 or b < level:
                level = b
    # the sources must lie within the ring of buckets: late ones are put in the last bucket of the ring
    for i in range(sources.shape[0]):
        ix, iy = sources[i, 0], sources[i, 1]
        f = float(times[iy, ix])
        if guided:
            f += heuristic * math.sqrt(float((ix - target_x) ** 2 + (iy - target_y) ** 2))
        b = min(np.int64(f / span), level + BUCKETS - 2)
        if used == node.shape[0]:
            node = np.concatenate((node, np.empty_like(node)))
            link = np.concatenate((link, np.empty_like(link)))
            key = np.concatenate((key, np.empty_like(key)))
        key[used] = times[iy, ix]
        node[used] = iy * width + ix
        link[used] = head[b % BUCKETS]
        head[b % BUCKETS] = used
        used += 1
        queued += 1
    while queued > 0:
        if head[level % BUCKETS] < 0:
            level += 1
            continue
        if target_x >= 0:
            at_goal = times[target_y, target_x]
            if math.isfinite(at_goal) and level * span > float(at_goal) + span:
                break
        entry = head[level % BUCKETS]
        head[level % BUCKETS] = link[entry]
        cell = node[entry]
        link[entry] = free
        free = entry
        queued -= 1
        cy, cx = cell // width, cell % width
        here = times[cy, cx]
        if here != key[entry]:
            continue  # a shorter way was found since, and queued
        for k in range(4):
            nx = cx + (1 if k == 0 else (-1 if k == 1 else 0))
            ny = cy + (1 if k == 2 else (-1 if k == 3 else 0))
            if nx < 0 or ny < 0 or nx >= width or ny >= height:
                continue
            c = table[costs[ny, nx]]
            old = times[ny, nx]
            if not math.isfinite(c) or old <= here:
                continue
            a = np.float32(np.inf)
            if nx > 0:
                a = times[ny, nx - 1]
            if nx + 1 < width:
                a = min(a, times[ny, nx + 1])
            b2 = np.float32(np.inf)
            if ny > 0:
                b2 = times[ny - 1, nx]
            if ny + 1 < height:
                b2 = min(b2, times[ny + 1, nx])
            low, high = min(a, b2), max(a, b2)
            if high - low >= c:
                t = low + c
            else:
                diff = high - low
                t = np.float32(0.5) * (low + high + np.float32(math.sqrt(2.0 * c * c - diff * diff)))
            if t >= old - np.float32(1e-3) * c:
                continue
            times[ny, nx] = t
            f = float(t)
            if guided:
                f += heuristic * math.sqrt(float((nx - target_x) ** 2 + (ny - target_y) ** 2))
            b = min(max(np.int64(f / span), level), level + BUCKETS - 2)
            if free >= 0:
                slot = free
                free = link[slot]
            else:
                if used == node.shape[0]:
                    node = np.concatenate((node, np.empty_like(node)))
                    link = np.concatenate((link, np.empty_like(link)))
                    key = np.concatenate((key, np.empty_like(key)))
                slot = used
                used += 1
            node[slot] = ny * width + nx
            key[slot] = t
            link[slot] = head[b % BUCKETS]
            head[b % BUCKETS] = slot
            queued += 1
    if target_x < 0 or math.isfinite(times[target_y, target_x]):
        return 1
    return 0


@kernel("UniTuple(float64, 2)(float32[:, ::1], int64, int64)")
def slope(times, ix, iy):
    """Gradient (uphill) at a cell's centre, upwind as the field was built."""
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
def descend(times, from_x, from_y, to_x, to_y, step):
    """Follow the fall of `times` from a point to (about) a source, in cells with centres at whole numbers.

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
        if abs(x - to_x) < 1.0 and abs(y - to_y) < 1.0:
            reached = 1
            break
        ix, iy = round(x), round(y)
        # gradient, interpolated between the four centres around, those without a way left out
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
