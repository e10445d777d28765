"""Inner loops that compute arrival times over a cost grid, wholly or within chosen blocks.

The field solves |grad T| = cost (the Eikonal equation; Sethian 1996) with first-order upwind differences, by a
label-correcting queue of buckets (Yatziv, Bartesaghi, Sapiro 2006).

Grids are divided into blocks of BLOCK x BLOCK cells. `limits[by, bx]` is the latest arrival worth keeping in a block:
inf for all, negative for none. Times of blocks without a limit are never written, so a search in a small part of a
large grid touches only that part of its memory.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

BUCKETS = 256
BLOCK = 8
_SHIFT = 3


@kernel("void(float32[:, ::1], float32[:, ::1])")
def open_blocks(limits: NDArray[np.float32], times: NDArray[np.float32]) -> None:
    """Set `times` to inf in all blocks with a limit and in their neighbours."""
    height, width = times.shape
    rows, columns = limits.shape
    for by in range(rows):
        for bx in range(columns):
            wanted = False
            for ny in range(max(by - 1, 0), min(by + 2, rows)):
                for nx in range(max(bx - 1, 0), min(bx + 2, columns)):
                    wanted = wanted or limits[ny, nx] >= 0.0
            if wanted:
                for iy in range(by * BLOCK, min(by * BLOCK + BLOCK, height)):
                    for ix in range(bx * BLOCK, min(bx * BLOCK + BLOCK, width)):
                        times[iy, ix] = np.inf


@kernel("uint8[:, ::1](uint8[:, ::1], uint8[::1])")
def cheapest_of_blocks(costs: NDArray[np.uint8], rank: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Least rank of each block's cells, shape (ceil(height / BLOCK), ceil(width / BLOCK)); rank has shape (256,)."""
    height, width = costs.shape
    columns = (width + BLOCK - 1) // BLOCK
    out = np.full(((height + BLOCK - 1) // BLOCK, columns), 255, np.uint8)
    whole = width // BLOCK
    for iy in range(height):
        row = out[iy >> _SHIFT]
        for bx in range(columns):
            low = row[bx]
            first = bx * BLOCK
            if bx < whole:
                for k in range(BLOCK):
                    low = min(low, rank[costs[iy, first + k]])
            else:
                for ix in range(first, width):
                    low = min(low, rank[costs[iy, ix]])
            row[bx] = low
    return out


@kernel(
    "int64(uint8[:, ::1], float32[::1], int64[:, ::1], float32[::1], int64, int64, float32[:, ::1], float32[:, ::1])",
)
def propagate(
    costs: NDArray[np.uint8],
    table: NDArray[np.float32],
    sources: NDArray[np.int64],
    source_times: NDArray[np.float32],
    target_x: int,
    target_y: int,
    limits: NDArray[np.float32],
    times: NDArray[np.float32],
) -> int:
    """Fill `times` from the sources until the target is settled, or everywhere if `target_x` is negative.

    Args:
        costs: cost of each cell.
        table: price of crossing a cell, by its cost; inf if impassable; shape (256,).
        sources: cells (ix, iy) to start from, shape (N, 2), in blocks that have a limit.
        source_times: their times, shape (N,).
        target_x: cell to reach, column.
        target_y: its row.
        limits: latest times worth keeping, by block.
        times: to be filled; inf at call wherever `limits` opens a block, and around (`open_blocks`).

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
    span = max(float(smallest) * 0.5, (largest + 1.0) * 2.0 / (BUCKETS - 4))
    per_span = 1.0 / span
    head = np.full(BUCKETS, -1, np.int64)
    node = np.empty(4096, np.int64)
    link = np.empty(4096, np.int64)
    key = np.empty(4096, np.float32)
    free, used, queued = np.int64(-1), np.int64(0), np.int64(0)
    level = np.int64(-1)
    for i in range(sources.shape[0]):
        ix, iy = sources[i, 0], sources[i, 1]
        times[iy, ix] = min(times[iy, ix], source_times[i])
        b = np.int64(times[iy, ix] * per_span)
        if level < 0 or b < level:
            level = b
    # the sources must lie within the ring of buckets: late ones are put in the last bucket of the ring
    for i in range(sources.shape[0]):
        ix, iy = sources[i, 0], sources[i, 1]
        b = min(np.int64(times[iy, ix] * per_span), level + BUCKETS - 2)
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
            continue  # a shorter path was found since, and queued
        for k in range(4):
            nx = cx + (1 if k == 0 else (-1 if k == 1 else 0))
            ny = cy + (1 if k == 2 else (-1 if k == 3 else 0))
            if nx < 0 or ny < 0 or nx >= width or ny >= height:
                continue
            limit = limits[ny >> _SHIFT, nx >> _SHIFT]
            if limit <= here:
                continue
            old = times[ny, nx]
            if old <= here:
                continue
            c = table[costs[ny, nx]]
            if not math.isfinite(c):
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
                t = np.float32(0.5) * (low + high + np.float32(math.sqrt(np.float32(2.0) * c * c - diff * diff)))
            if t >= old - np.float32(1e-3) * c or t > limit:
                continue
            times[ny, nx] = t
            b = min(max(np.int64(t * per_span), level), level + BUCKETS - 2)
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
