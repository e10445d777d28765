"""Which cells can be reached, and through what."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.kernels import kernel


@kernel("uint8[:, ::1](uint8[:, ::1], uint8[::1], int64, int64, int64, int64, int64)")
def flood(costs, kinds, start_x, start_y, goal_x, goal_y, worst):
    """Flood from a cell over its edges, through kind 0 as far as it goes, then through kind 1, and so on.

    Args:
        costs: cost of each cell.
        kinds: kind of a cell by its cost, 0 to 3; shape (256,). The start counts as kind 0.
        start_x: column of the start.
        start_y: its row.
        goal_x: column of the cell to stop at, negative where there is none.
        goal_y: its row.
        worst: last kind to flood through.

    Returns:
        Where each cell was entered from, shape of `costs`: 0 not at all, 1 to 4 from -x, +x, -y, +y, 5 the start.
        Cells of a kind above the one flooded last are marked where the flood touched them.
    """
    height, width = costs.shape
    came = np.zeros((height, width), np.uint8)
    came[start_y, start_x] = 5
    now = np.empty(4096, np.int64)
    now[0] = start_y * width + start_x
    filled = 1
    later = np.empty(4096, np.int64)
    later_kind = np.empty(4096, np.uint8)
    waiting = 0
    for level in range(worst + 1):
        kept = 0
        for i in range(waiting):
            if later_kind[i] <= level:
                if filled == now.shape[0]:
                    now = np.concatenate((now, np.empty_like(now)))
                now[filled] = later[i]
                filled += 1
            else:
                later[kept], later_kind[kept] = later[i], later_kind[i]
                kept += 1
        waiting = kept
        i = 0
        while i < filled:
            cell = now[i]
            i += 1
            cy, cx = cell // width, cell % width
            for k in range(1, 5):
                nx = cx + (1 if k == 1 else (-1 if k == 2 else 0))
                ny = cy + (1 if k == 3 else (-1 if k == 4 else 0))
                if nx < 0 or ny < 0 or nx >= width or ny >= height or came[ny, nx] != 0:
                    continue
                came[ny, nx] = k
                kind = kinds[costs[ny, nx]]
                if kind <= level:
                    if nx == goal_x and ny == goal_y:
                        return came
                    if filled == now.shape[0]:
                        now = np.concatenate((now, np.empty_like(now)))
                    now[filled] = ny * width + nx
                    filled += 1
                else:
                    if waiting == later.shape[0]:
                        later = np.concatenate((later, np.empty_like(later)))
                        later_kind = np.concatenate((later_kind, np.empty_like(later_kind)))
                    later[waiting], later_kind[waiting] = ny * width + nx, kind
                    waiting += 1
        filled = 0
    return came
