"""Inner loops of the inflation layer: bounded exact Euclidean distances, converted to costs.

Distances separate into columns and rows (Meijster, Roerdink, Hesselink 2000): d2(x, y) is the least over x' of
(x - x')^2 + g(x', y)^2, where g is the distance along the column to the nearest lethal cell. For reaches of up to
`NEAR` cells everything is 8 and 16 bits wide and runs in vector registers: the columns by two sweeps over whole rows,
the rows by trying x' outwards over blocks of cells until no nearer one is possible. Wider reaches take the lower
envelope of the parabolas.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

NEAR = 254  # cells; its square still fits 16 bits
_BLOCK = 64  # cells of a row that are worked on at once
_SHIFT = 6  # log2 of it
_STEPS = 16  # distances tried between two checks whether to stop
_PAD = 336  # padding of a row: NEAR, the last steps and a block; none of its cells is lethal
_BAND = 128  # rows whose column distances are held at once
_NONE = np.uint16(65535)
_ONE, _TWO, _THREE = np.uint64(1), np.uint64(2), np.uint64(3)


@kernel("uint16(int64)")
def _square(d: int) -> int:
    return np.uint16(min(d * d, 65535))


@kernel("uint16(uint16, uint16)")
def _plus(a: int, b: int) -> int:
    """Saturating sum."""
    total = np.uint16(a + b)
    return total if total >= b else _NONE


@kernel(inline="never")
def _nearest_in_row(
    squares: NDArray[np.uint16], at: int, reach: int, least: NDArray[np.uint16], d2_max: int, found: NDArray[np.uint16]
) -> bool:
    """Compute the least d2 of a block of cells; False if none is near enough to change, or all are lethal.

    Args:
        squares: g^2 of the row, with _PAD cells more on each side.
        at: index of the block's first cell in it.
        reach: how far a lethal cell reaches [cells].
        least: least of `squares` in each block of the row.
        d2_max: squared distances above do not matter.
        found: the result, shape (_BLOCK,).
    """
    last = len(least) - 1
    nearest = _NONE
    for k in range(max((at - reach - _PAD) >> _SHIFT, 0), min((at + reach + _BLOCK - 1 - _PAD) >> _SHIFT, last) + 1):
        nearest = min(nearest, least[k])
    if nearest > d2_max:
        return False
    here = squares[at : at + _BLOCK]
    top = np.uint16(0)
    for j in range(_BLOCK):
        found[j] = here[j]
        top = max(top, here[j])
    if top == 0:
        return False
    bound = min(np.int64(top), d2_max + 1)  # a smaller d2 would still change the result
    step = 1
    while step <= reach and step * step < bound:
        end = min(step + _STEPS, reach + 1)
        limit = bound - step * step
        low, high = at - end + 1 - _PAD, at - step + _BLOCK - 1 - _PAD
        near = False
        for k in range(max(low >> _SHIFT, 0), min(high >> _SHIFT, last) + 1):
            near |= least[k] < limit
        low, high = at + step - _PAD, at + end + _BLOCK - 2 - _PAD
        for k in range(max(low >> _SHIFT, 0), min(high >> _SHIFT, last) + 1):
            near |= least[k] < limit
        if near:
            for d in range(step, step + _STEPS, 4):  # four at once keep `found` in registers
                s0, s1, s2, s3 = _square(d), _square(d + 1), _square(d + 2), _square(d + 3)
                l0, r0 = np.uint64(at - d), np.uint64(at + d)  # unsigned: no check for negative indices
                l1, r1, l2, r2, l3, r3 = l0 - _ONE, r0 + _ONE, l0 - _TWO, r0 + _TWO, l0 - _THREE, r0 + _THREE
                for j in range(_BLOCK):
                    i = np.uint64(j)
                    d2 = min(found[j], _plus(min(squares[l0 + i], squares[r0 + i]), s0))
                    d2 = min(d2, _plus(min(squares[l1 + i], squares[r1 + i]), s1))
                    d2 = min(d2, _plus(min(squares[l2 + i], squares[r2 + i]), s2))
                    found[j] = min(d2, _plus(min(squares[l3 + i], squares[r3 + i]), s3))
            top = np.uint16(0)
            for j in range(_BLOCK):
                top = max(top, found[j])
            bound = min(np.int64(top), d2_max + 1)
        step = end
    return True


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64, int64, uint8[::1], uint8)")
def inflate(
    source: NDArray[np.uint8],
    out: NDArray[np.uint8],
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    reach: int,
    table: NDArray[np.uint8],
    floor: int,
) -> None:
    """Raise the costs of out[y0:y1, x0:x1] by the distance to the nearest lethal cell of `source`.

    Args:
        source: where lethal cells are looked for, also up to `reach` outside the rectangle; may be `out` itself.
        out: costs, raised in place; the same shape.
        x0: left of the rectangle [cells].
        y0: its lower edge.
        x1: its right edge, not included.
        y1: its upper edge, not included.
        reach: how far a lethal cell reaches [cells], at most NEAR.
        table: cost at each squared distance [cells], shape (65536,); 0 above reach^2.
        floor: unknown cells take costs from here on.
    """
    height, width = source.shape
    rx0, rx1 = max(x0 - reach, 0), min(x1 + reach, width)
    ry0, ry1 = max(y0 - reach, 0), min(y1 + reach, height)
    w = rx1 - rx0
    blocks = (w + _BLOCK - 1) >> _SHIFT
    down = np.empty((_BAND, w), np.uint8)  # distance to the nearest lethal cell at a lower index, 255 is none
    below, above = np.full(w, np.uint8(255)), np.empty(w, np.uint8)
    squares = np.full(_PAD + blocks * _BLOCK + _PAD, _NONE)
    row = squares[_PAD : _PAD + w]
    least = np.empty(blocks, np.uint16)
    found = np.empty(_BLOCK, np.uint16)
    cost = np.empty(_BLOCK, np.uint8)
    d2_max = reach * reach
    one, none = np.uint8(1), np.uint8(255)
    for iy in range(ry0, y0):
        cells = source[iy, rx0:rx1]
        for x in range(w):
            below[x] = np.uint8(0) if cells[x] == 254 else np.uint8(min(below[x], np.uint8(254)) + one)
    for start in range(y0, y1, _BAND):
        end = min(start + _BAND, y1)
        for iy in range(start, end):
            cells, kept = source[iy, rx0:rx1], down[iy - start]
            for x in range(w):
                d = np.uint8(0) if cells[x] == 254 else np.uint8(min(below[x], np.uint8(254)) + one)
                below[x] = d
                kept[x] = d
        above[:] = none
        for iy in range(min(end + reach, ry1) - 1, end - 1, -1):
            cells = source[iy, rx0:rx1]
            for x in range(w):
                above[x] = np.uint8(0) if cells[x] == 254 else np.uint8(min(above[x], np.uint8(254)) + one)
        for iy in range(end - 1, start - 1, -1):
            kept = down[iy - start]
            smallest = none
            for x in range(w):
                d = min(np.uint8(min(above[x], np.uint8(254)) + one), kept[x])
                above[x] = d
                smallest = min(smallest, d)
                row[x] = np.uint16(np.uint16(d) * np.uint16(d))
            if smallest > reach:
                continue
            for k in range(blocks):
                part = squares[_PAD + (k << _SHIFT) : _PAD + ((k + 1) << _SHIFT)]
                m = _NONE
                for j in range(_BLOCK):
                    m = min(m, part[j])
                least[k] = m
            for x in range(x0, x1, _BLOCK):
                if not _nearest_in_row(squares, _PAD + x - rx0, reach, least, d2_max, found):
                    continue
                for j in range(_BLOCK):
                    cost[j] = table[found[j]]
                old = out[iy, x : min(x + _BLOCK, x1)]
                for j in range(len(old)):
                    was, new = old[j], cost[j]
                    unknown = new if new >= floor else none
                    known = max(was, new)
                    old[j] = unknown if was == 255 else known


@kernel("void(uint8[:, ::1], uint8[:, ::1], int64, int64, int64, int64, int64, uint8[::1], uint8)")
def inflate_far(
    source: NDArray[np.uint8],
    out: NDArray[np.uint8],
    x0: int,
    y0: int,
    x1: int,
    y1: int,
    reach: int,
    table: NDArray[np.uint8],
    floor: int,
) -> None:
    """As `inflate`, for any reach; `table` has reach^2 + 1 costs."""
    height, width = source.shape
    rx0, rx1 = max(x0 - reach, 0), min(x1 + reach, width)
    ry0, ry1 = max(y0 - reach, 0), min(y1 + reach, height)
    w, h = rx1 - rx0, ry1 - ry0
    cap = reach + 1
    down = np.empty((h, w), np.uint16)
    for x in range(w):
        down[0, x] = 0 if source[ry0, rx0 + x] == 254 else cap
    for y in range(1, h):
        for x in range(w):
            down[y, x] = 0 if source[ry0 + y, rx0 + x] == 254 else min(down[y - 1, x] + 1, cap)
    for y in range(h - 2, -1, -1):
        for x in range(w):
            down[y, x] = min(down[y + 1, x] + 1, down[y, x])
    site = np.empty(w, np.int64)  # columns of the envelope's parabolas,
    site_d2 = np.empty(w, np.int64)  # their height
    start = np.empty(w, np.int64)  # and where each becomes the lowest
    for iy in range(y0, y1):
        row = down[iy - ry0]
        n = 0
        for u in range(w):
            g2 = np.int64(row[u]) * np.int64(row[u])
            if g2 > reach * reach:
                continue
            begin = 0
            while n > 0:
                v = site[n - 1]
                begin = math.floor((u * u - v * v + g2 - site_d2[n - 1]) / (2.0 * (u - v))) + 1
                if begin > start[n - 1]:
                    break
                n -= 1
            if n == 0:
                begin = 0
            if begin < w:
                site[n], site_d2[n], start[n] = u, g2, max(begin, 0)
                n += 1
        k = 0
        for u in range(x0 - rx0, x1 - rx0):
            if n == 0:
                break
            while k + 1 < n and start[k + 1] <= u:
                k += 1
            d2 = (u - site[k]) * (u - site[k]) + site_d2[k]
            if d2 > reach * reach or d2 == 0:
                continue
            was, new = out[iy, rx0 + u], table[d2]
            if was == 255:
                out[iy, rx0 + u] = new if new >= floor else was
            elif new > was:
                out[iy, rx0 + u] = new
