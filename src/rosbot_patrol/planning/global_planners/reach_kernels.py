"""Flood fill over a costmap: which cells can be reached, and through which kinds of cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel("Tuple((uint8[:, ::1], int64))(uint8[:, ::1], uint8[::1], int64, int64, int64, int64, int64, int64)")
def flood(
    costs: NDArray[np.uint8],
    kinds: NDArray[np.uint8],
    start_x: int,
    start_y: int,
    goal_x: int,
    goal_y: int,
    worst: int,
    enough: int,
) -> tuple[NDArray[np.uint8], int]:
    """Flood from a cell over its edges: through kind 0 as far as possible, then through kind 1, and so on.

    Args:
        costs: cost of each cell.
        kinds: kind of a cell by its cost, 0 to 3; shape (256,). The start counts as kind 0.
        start_x: column of the start.
        start_y: its row.
        goal_x: column of the cell to stop at; negative: none.
        goal_y: its row.
        worst: last kind to flood through.
        enough: number of cells of kind 0 after which to stop; negative: never.

    Returns:
        Where each cell was entered from, shape of `costs`: 0 not at all, 1 to 4 from -x, +x, -y, +y, 5 the start; cells
        of a kind above the one flooded last are marked where the flood touched them. And how many cells of kind 0 were
        reached through kind 0 alone.
    """
    height, width = costs.shape
    came = np.zeros((height, width), np.uint8)
    came[start_y, start_x] = 5
    front = np.empty(4096, np.int32)
    onward = np.empty(4096, np.int32)
    front[0] = start_y * width + start_x
    filled, opened = 1, 1
    later = np.empty(4096, np.int32)
    waiting = 0
    for level in range(worst + 1):
        kept = 0
        for i in range(waiting):
            cell = later[i]
            if kinds[costs[cell // width, cell % width]] <= level:
                if filled == front.shape[0]:
                    front = np.concatenate((front, np.empty_like(front)))
                front[filled] = cell
                filled += 1
            else:
                later[kept] = cell
                kept += 1
        waiting = kept
        while filled > 0:
            count = 0
            for i in range(filled):
                cy, cx = front[i] // width, front[i] % width
                if cx == goal_x and cy == goal_y:
                    return came, opened
                for k in range(1, 5):
                    nx = cx + (1 if k == 1 else (-1 if k == 2 else 0))
                    ny = cy + (1 if k == 3 else (-1 if k == 4 else 0))
                    if nx < 0 or ny < 0 or nx >= width or ny >= height or came[ny, nx] != 0:
                        continue
                    came[ny, nx] = k
                    if kinds[costs[ny, nx]] <= level:
                        if count == onward.shape[0]:
                            onward = np.concatenate((onward, np.empty_like(onward)))
                        onward[count] = ny * width + nx
                        count += 1
                    else:
                        if waiting == later.shape[0]:
                            later = np.concatenate((later, np.empty_like(later)))
                        later[waiting] = ny * width + nx
                        waiting += 1
            front, onward = onward, front
            filled = count
            if level == 0:
                opened += count
                if 0 <= enough <= opened:
                    return came, opened
    return came, opened
