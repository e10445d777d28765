"""Inner loops over maps in tiles of 16 x 16 cells; maps share tiles until one of them writes.

A map is a table of tile numbers, shape (TY, TX), -1 for unseen tiles. All maps take their tiles from one array `cells`
of shape (T, 272, 5). For each cell it keeps

    HITS     beams that ended here
    VISITS   beams that ended here or went through
    MEAN_X   mean place of the ends within the cell, in 1/65535 of its edge
    MEAN_Y   likewise
    STAMP    number of the scan that hit it last

and for each of its 16 rows, from number 256 on,

    WALLS    which of its cells are walls, as bits from the lowest column

`refs` counts the maps that use a tile, shape (T,). `free` is a stack of unused tiles, shape (T + 1,): free[0] is their
number, then follow their indices. Coordinates are in cells from the lower left corner of the table.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Array = NDArray[np.float64]
Table = NDArray[np.int32]
Cells = NDArray[np.uint16]

BITS, TILE, MASK, AREA = 4, 16, 15, 256
HITS, VISITS, MEAN_X, MEAN_Y, STAMP, FIELDS = 0, 1, 2, 3, 4, 5
WALLS, ROWS = 4, AREA + TILE
FULL = 65535
FULL_SHARE = 10  # a cell is a wall if more than one in this many beams ended in it


@kernel("int64(int32[:, ::1], uint16[:, :, ::1], int64, int64, int64)")
def walls_from(table: Table, cells: Cells, x: int, y: int, count: int) -> int:
    """Bits of the walls among `count` cells (48 at most) from column x on in row y; cells may lie outside."""
    ty, bits = y >> BITS, np.int64(0)
    if ty < 0 or ty >= table.shape[0]:
        return 0
    first = x >> BITS
    for tx in range(first, ((x + count - 1) >> BITS) + 1):
        if tx >= 0 and tx < table.shape[1] and table[ty, tx] >= 0:
            bits |= np.int64(cells[table[ty, tx], AREA + (y & MASK), WALLS]) << np.int64((tx - first) << BITS)
    return int((bits >> np.int64(x & MASK)) & ((np.int64(1) << np.int64(count)) - 1))


@kernel()
def _tell_wall(cells: Cells, tile: int, cell: int) -> None:
    """Record whether a cell counts as a wall for scan matching."""
    row, bit = AREA + (cell >> BITS), np.int64(1) << np.int64(cell & MASK)
    before = np.int64(cells[tile, row, WALLS])
    is_wall = np.int64(cells[tile, cell, HITS]) * FULL_SHARE > np.int64(cells[tile, cell, VISITS])
    cells[tile, row, WALLS] = before | bit if is_wall else before & ~bit


@kernel()
def own_tile(table: Table, cells: Cells, refs: Table, free: Table, ty: int, tx: int) -> int:
    """Get a tile of the table that no other map uses: a new one, or a copy of the shared one."""
    tile = table[ty, tx]
    if tile >= 0 and refs[tile] == 1:
        return int(tile)
    new = free[free[0]]
    free[0] -= 1
    refs[new] = 1
    table[ty, tx] = new
    if tile < 0:
        cells[new] = 0
    else:
        cells[new] = cells[tile]
        refs[tile] -= 1
    return int(new)


@kernel()
def _count_hit(cells: Cells, tile: int, cell: int, x: float, y: float) -> None:
    """Count a beam that ended at (x, y) within the cell."""
    n = int(cells[tile, cell, HITS]) + 1
    cells[tile, cell, HITS] = n
    for field, at in ((MEAN_X, x), (MEAN_Y, y)):
        old = float(cells[tile, cell, field])
        cells[tile, cell, field] = int(old + (at * FULL - old) / n + 0.5)
    _tell_wall(cells, tile, cell)


@kernel()
def _count_visit(cells: Cells, tile: int, cell: int, most: int) -> None:
    """Count a beam; both counts are halved at `most`, so that older beams count less."""
    visits = int(cells[tile, cell, VISITS])
    if visits >= most:
        visits >>= 1
        cells[tile, cell, HITS] = int(cells[tile, cell, HITS]) >> 1
    cells[tile, cell, VISITS] = visits + 1
    if cells[tile, cell, HITS] > 0:
        _tell_wall(cells, tile, cell)


@kernel(
    "int64(int32[:, ::1], uint16[:, :, ::1], int32[::1], int32[::1], float64[:, ::1], boolean[::1], int64, int64,"
    " int64)"
)
def register_hits(
    table: Table,
    cells: Cells,
    refs: Table,
    free: Table,
    ends: Array,
    is_hit: NDArray[np.bool_],
    stamp: int,
    first: int,
    most: int,
) -> int:
    """Write the ends of a scan's beams into a map.

    Args:
        table: of the map; its tiles must cover the scan.
        cells: of all maps.
        refs: of the tiles.
        free: unused tiles.
        ends: of the beams, shape (K, 2).
        is_hit: whether a beam hit something there, or was only cut there, shape (K,).
        stamp: number of the scan, 1 to 65535.
        first: index of the first beam to write.
        most: number of beams of a cell at which its counts are halved, up to 65535.

    Returns:
        Index of the beam before which the unused tiles might run out, K if all are written.
    """
    for k in range(first, ends.shape[0]):
        if free[0] < 1:
            return k
        if is_hit[k]:
            ix, iy = math.floor(ends[k, 0]), math.floor(ends[k, 1])
            tile = own_tile(table, cells, refs, free, iy >> BITS, ix >> BITS)
            cell = ((iy & MASK) << BITS) + (ix & MASK)
            _count_visit(cells, tile, cell, most)
            _count_hit(cells, tile, cell, ends[k, 0] - ix, ends[k, 1] - iy)
            cells[tile, cell, STAMP] = stamp
    return ends.shape[0]


@kernel(
    "int64(int32[:, ::1], uint16[:, :, ::1], int32[::1], int32[::1], float64[::1], float64[:, ::1], int64, int64,"
    " int64)"
)
def register_rays(
    table: Table, cells: Cells, refs: Table, free: Table, start: Array, ends: Array, stamp: int, first: int, most: int
) -> int:
    """Count a visit for each cell that a beam crosses before its end.

    Cells hit by a beam of the same scan are skipped: beams that graze a wall would erode it.

    Args:
        table: of the map; its tiles must cover the scan.
        cells: of all maps.
        refs: of the tiles.
        free: unused tiles.
        start: the sensor, x and y, shape (2,).
        ends: of the beams, shape (K, 2).
        stamp: number of the scan, 1 to 65535.
        first: index of the first beam to write.
        most: number of beams of a cell at which its counts are halved, up to 65535.

    Returns:
        Index of the beam before which the unused tiles might run out, K if all are written.
    """
    x0, y0 = start[0], start[1]
    low_x, high_x, low_y, high_y = x0, x0, y0, y0
    for k in range(first, ends.shape[0]):
        low_x, high_x = min(low_x, ends[k, 0]), max(high_x, ends[k, 0])
        low_y, high_y = min(low_y, ends[k, 1]), max(high_y, ends[k, 1])
    low_tx, low_ty = (math.floor(low_x) >> BITS) - 1, (math.floor(low_y) >> BITS) - 1
    shape = (math.floor(high_y) >> BITS) - low_ty + 2, (math.floor(high_x) >> BITS) - low_tx + 2
    owned = np.full(shape, -1, dtype=np.int32)  # tiles around the rays that already belong to this map alone
    for k in range(first, ends.shape[0]):
        dx, dy = ends[k, 0] - x0, ends[k, 1] - y0
        if free[0] < int(abs(dx) + abs(dy)) // TILE + 4:
            return k
        ix, iy = math.floor(x0), math.floor(y0)
        step_x, step_y = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
        each_x = 1.0 / abs(dx) if dx != 0.0 else 1e300
        each_y = 1.0 / abs(dy) if dy != 0.0 else 1e300
        next_x = (ix + 1.0 - x0 if dx > 0.0 else x0 - ix) * each_x
        next_y = (iy + 1.0 - y0 if dy > 0.0 else y0 - iy) * each_y
        for _ in range(abs(math.floor(ends[k, 0]) - ix) + abs(math.floor(ends[k, 1]) - iy)):
            tx, ty = ix >> BITS, iy >> BITS
            tile = owned[ty - low_ty, tx - low_tx]
            if tile < 0:
                tile = np.int32(own_tile(table, cells, refs, free, ty, tx))
                owned[ty - low_ty, tx - low_tx] = tile
            cell = ((iy & MASK) << BITS) + (ix & MASK)
            if cells[tile, cell, STAMP] != stamp:
                _count_visit(cells, tile, cell, most)
            if next_x < next_y:
                next_x += each_x
                ix += step_x
            else:
                next_y += each_y
                iy += step_y
    return ends.shape[0]


@kernel("void(int32[:, :, ::1], int32[::1], int32[::1])")
def count_references(tables: Table, refs: Table, free: Table) -> None:
    """Recount the references of all tiles, and rebuild the stack of unused ones."""
    refs[:] = 0
    count, height, width = tables.shape
    for i in range(count):
        for y in range(height):
            for x in range(width):
                if tables[i, y, x] >= 0:
                    refs[tables[i, y, x]] += 1
    unused = 0
    for tile in range(refs.shape[0] - 1, -1, -1):
        if refs[tile] == 0:
            unused += 1
            free[unused] = tile
    free[0] = unused


@kernel("void(int32[:, ::1], uint16[:, :, ::1], float64, int8[:, ::1])")
def render(table: Table, cells: Cells, threshold: float, out: NDArray[np.int8]) -> None:
    """A map as occupancy: 100 if more than `threshold` of the beams ended there, 0 if fewer, -1 if none came.

    `out` has 16 rows and columns for each of the table's.
    """
    out[:] = -1
    for ty in range(table.shape[0]):
        for tx in range(table.shape[1]):
            tile = table[ty, tx]
            if tile < 0:
                continue
            for cell in range(AREA):
                visits = int(cells[tile, cell, VISITS])
                if visits > 0:
                    hits = int(cells[tile, cell, HITS])
                    out[(ty << BITS) + (cell >> BITS), (tx << BITS) + (cell & MASK)] = (
                        100 if hits > threshold * visits else 0
                    )
