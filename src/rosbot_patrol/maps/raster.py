"""Drawing of plane shapes on a grid, as a lidar would map them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.grid import GridInfo, cells_of_points
from rosbot_patrol.maps.occupancy import FREE, OCCUPIED, UNKNOWN

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]
Part = tuple[slice, slice]


def convex_hull(points: Points) -> Points:
    """Corners of the convex hull of points of shape (N, 2), counter-clockwise, shape (M, 2) (monotone chain)."""
    ordered = np.unique(points, axis=0)
    if len(ordered) < 3:
        return ordered

    def chain(rows: Points) -> list[Points]:
        kept: list[Points] = []
        for row in rows:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], row) <= 1e-12:
                kept.pop()
            kept.append(row)
        return kept[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))


def _turn(a: Points, b: Points, c: Points) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def slice_hull(vertices: Points, height: float) -> Points:
    """Cut the convex hull of points of shape (N, 3) at a height; corners of shape (M, 2), M = 0 if it misses.

    Every edge of the hull joins two of the points, so the cuts of all pairs across the height span the slice.
    """
    above, below = vertices[vertices[:, 2] >= height], vertices[vertices[:, 2] < height]
    if not len(above) or not len(below):
        return np.empty((0, 2))
    span = above[:, None, 2] - below[None, :, 2]
    share = (height - below[None, :, 2]) / span
    cuts = below[None, :, :2] + share[..., None] * (above[:, None, :2] - below[None, :, :2])
    return convex_hull(cuts.reshape(-1, 2))


def is_inside(points: Points, polygon: Points, margin: float = 0.0) -> Mask:
    """Which points, shape (N, 2), lie in a convex counter-clockwise polygon, by more than `margin` [m]."""
    inside = np.ones(len(points), dtype=bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        edge = b - a
        length = math.hypot(*edge)
        if length > 0.0:
            across = edge[0] * (points[:, 1] - a[1]) - edge[1] * (points[:, 0] - a[0])
            inside &= across > margin * length
    return inside


def outline_points(polygon: Points, step: float) -> Points:
    """Points along the outline of a polygon, at most `step` [m] apart, shape (N, 2)."""
    parts = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        count = max(math.ceil(math.hypot(*(b - a)) / step), 1)
        parts.append(a + (b - a) * np.arange(count)[:, None] / count)
    return np.concatenate(parts)


def surface_cells(info: GridInfo, polygons: Sequence[Points]) -> tuple[Mask, Mask]:
    """Cells of convex obstacles on a grid: those that their common surface crosses, and those that they fill.

    An obstacle of two points is a line: it is passed and fills only the cells that it goes through.

    A cell counts as crossed if a part of an outline in it lies in no other obstacle: beams end in those cells.
    """
    passed, filled = np.zeros(info.shape, dtype=bool), np.zeros(info.shape, dtype=bool)
    lows = np.array([polygon.min(axis=0) for polygon in polygons]).reshape(-1, 2)
    highs = np.array([polygon.max(axis=0) for polygon in polygons]).reshape(-1, 2)
    solid = np.array([len(polygon) > 2 for polygon in polygons], dtype=bool)
    for i, polygon in enumerate(polygons):
        points = outline_points(polygon, info.resolution / 10.0)
        outer = np.ones(len(points), dtype=bool)
        meets = solid & np.all(lows <= highs[i], axis=1) & np.all(lows[i] <= highs, axis=1)
        for k in np.flatnonzero(meets):
            if k != i:
                outer &= ~is_inside(points, polygons[k], 1e-6)
        _mark(passed, info, points[outer])
        _mark(filled, info, points)
        _fill(filled, info, polygon)
    return passed, filled


def _mark(mask: Mask, info: GridInfo, points: Points) -> None:
    cells = cells_of_points(info, points)
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < info.width) & (cells[:, 1] < info.height)
    mask[cells[inside, 1], cells[inside, 0]] = True


def _fill(mask: Mask, info: GridInfo, polygon: Points) -> None:
    x0, y0 = info.cell_of_clamped(*polygon.min(axis=0))
    x1, y1 = info.cell_of_clamped(*polygon.max(axis=0))
    ix, iy = np.meshgrid(np.arange(x0, x1 + 1), np.arange(y0, y1 + 1))
    centres = np.column_stack(
        (info.origin_x + (ix.ravel() + 0.5) * info.resolution, info.origin_y + (iy.ravel() + 0.5) * info.resolution)
    )
    inside = is_inside(centres, polygon)
    mask[iy.ravel()[inside], ix.ravel()[inside]] = True


def flood(is_open: Mask, ix: int, iy: int) -> Mask:
    """Cells that can be reached from (ix, iy) over open cells, along rows and columns; it spreads by runs."""
    reached = np.zeros_like(is_open)
    height, width = is_open.shape
    pending = [(ix, iy)]
    while pending:
        x, y = pending.pop()
        if reached[y, x] or not is_open[y, x]:
            continue
        row = is_open[y]
        closed_left = np.flatnonzero(~row[:x])
        closed_right = np.flatnonzero(~row[x:])
        left = int(closed_left[-1]) + 1 if len(closed_left) else 0
        right = x + int(closed_right[0]) if len(closed_right) else width
        reached[y, left:right] = True
        for other in (y - 1, y + 1):
            if 0 <= other < height:
                fresh = is_open[other, left:right] & ~reached[other, left:right]
                starts = np.flatnonzero(fresh & ~np.concatenate(([False], fresh[:-1])))
                pending.extend((left + int(s), other) for s in starts)
    return reached


def seen_map(passed: Mask, filled: Mask, ix: int, iy: int) -> NDArray[np.int8]:
    """Map that a robot would draw after it has been everywhere, starting at a cell.

    Reachable cells are free, the surfaces around them are occupied, and the rest, such as inside walls, is unknown.
    """
    free = flood(~filled, ix, iy)
    beside = np.zeros_like(free)
    height, width = free.shape
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            source = free[max(-dy, 0) : height - max(dy, 0), max(-dx, 0) : width - max(dx, 0)]
            beside[max(dy, 0) : height - max(-dy, 0), max(dx, 0) : width - max(-dx, 0)] |= source
    cells = np.full(free.shape, UNKNOWN, dtype=np.int8)
    cells[free] = FREE
    cells[passed & filled & beside & ~free] = OCCUPIED
    return cells


def grown(mask: Mask, cells: float) -> Mask:
    """A mask grown by this many cells: every cell within that distance of one of it."""
    out = mask.copy()
    for to, of in _shifts(mask.shape, cells):
        out[to] |= mask[of]
    return out


def counted(mask: Mask, cells: float) -> NDArray[np.int32]:
    """How many cells of a mask lie within a distance in cells, for every cell."""
    out = np.zeros(mask.shape, np.int32)
    for to, of in _shifts(mask.shape, cells):
        out[to] += mask[of]
    return out


def _shifts(shape: tuple[int, ...], cells: float) -> Iterator[tuple[Part, Part]]:
    """Where each shift of a grid by at most a distance in cells puts it, and which part of it that is."""
    reach = math.ceil(cells)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if dx * dx + dy * dy <= cells * cells:
                to = (slice(max(dy, 0), shape[0] + min(dy, 0)), slice(max(dx, 0), shape[1] + min(dx, 0)))
                yield to, (slice(max(-dy, 0), shape[0] + min(-dy, 0)), slice(max(-dx, 0), shape[1] + min(-dx, 0)))
