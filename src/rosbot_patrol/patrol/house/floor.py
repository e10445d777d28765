"""Floor of a map on a grid coarse enough for plain numpy, with the clearance to obstacles.

The patrol uses it to decide where a person could be, where the robot can stand and how far one can see. Unknown cells
of the map are no floor: the inside of a cupboard, or space beyond a window. But where floor runs into them without an
obstacle between, as behind a desk that the mapping drove past, somebody may stand there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.raster import counted, grown
from rosbot_patrol.maps.zones import Zone, zones_mask

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]

EDGE = 0.1  # of a cell of the floor [m]
CLEARANCE_MOST = 1.0  # clearances are exact up to here [m]
_SKIPPED = 0.2  # skipped start of a line of sight: the robot itself stands there [m]
_MARGIN = 0.3  # around the known part of the map [m]
_BODY = 0.2  # radius of a person [m]
_DEPTH = 1.5  # of unmapped floor beyond the mapped [m]
_UNMAPPED = 0.01  # clearance of it: it belongs to a room, and nobody drives there [m]


@dataclass(frozen=True)
class Floor:
    """Free floor of a map.

    Attributes:
        info: place and size of the grid, in the map's frame.
        free: floor, mapped or not, shape (height, width).
        clearance: distance of a floor cell from obstacles and unknown cells [m], at most CLEARANCE_MOST; 0 elsewhere.
        unmapped: cells of `free` that are unknown on the map, and that mapped floor runs into.
    """

    info: GridInfo
    free: Mask
    clearance: Array
    unmapped: Mask

    @property
    def cell_area(self) -> float:
        """[m^2]."""
        return self.info.resolution**2

    def is_free(self, x: float, y: float) -> bool:
        """Whether a point lies on mapped floor."""
        ix, iy = self.info.cell_of(x, y)
        return self.info.contains_cell(ix, iy) and bool(self.free[iy, ix] and not self.unmapped[iy, ix])

    def nearest(self, mask: Mask, x: float, y: float, within: float = math.inf) -> tuple[int, int] | None:
        """(ix, iy) of the mask's cell nearest to a point, None if there is none within a distance [m]."""
        iy, ix = np.nonzero(mask)
        if not len(ix):
            return None
        xs, ys = self.centres(ix, iy)
        gaps = np.hypot(xs - x, ys - y)
        k = int(gaps.argmin())
        return (int(ix[k]), int(iy[k])) if gaps[k] <= within else None

    def centres(self, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> tuple[Array, Array]:
        """Positions x and y of cells' centres [m]."""
        i = self.info
        return i.origin_x + (ix + 0.5) * i.resolution, i.origin_y + (iy + 0.5) * i.resolution

    def indices(self, xs: Array, ys: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Mask]:
        """ix, iy of points, clipped to the grid, and which lie inside."""
        i = self.info
        ix = np.floor((xs - i.origin_x) / i.resolution).astype(np.int64)
        iy = np.floor((ys - i.origin_y) / i.resolution).astype(np.int64)
        inside = (ix >= 0) & (iy >= 0) & (ix < i.width) & (iy < i.height)
        return ix.clip(0, i.width - 1), iy.clip(0, i.height - 1), inside

    def before(self, eye: tuple[float, float], x: float, y: float, most: float) -> tuple[float, float]:
        """Last free place on the line from an eye to a place, if that is at most `most` before it; else the place.

        Args:
            eye: position of the viewer [m].
            x: of the place [m].
            y: of the place [m].
            most: largest excess of the measured distance [m].
        """
        away = math.hypot(x - eye[0], y - eye[1])
        along = np.arange(_SKIPPED, away, EDGE / 2.0)
        if not len(along):
            return x, y
        xs, ys = (a + (b - a) / away * along for a, b in ((eye[0], x), (eye[1], y)))
        stopped = ~self.are_free(xs, ys)
        k = int(stopped.argmax()) - 1
        if not stopped.any() or k < 0 or away - along[k] > most:
            return x, y
        return float(xs[k]), float(ys[k])

    def are_free(self, xs: Array, ys: Array) -> Mask:
        """Whether points lie on the floor, mapped or not."""
        i = self.info
        ix = ((xs - i.origin_x) * (1.0 / i.resolution)).astype(
            np.int32
        )  # rounds towards 0; the cells there are no floor
        iy = ((ys - i.origin_y) * (1.0 / i.resolution)).astype(np.int32)
        found: Mask = self.free.take(iy * i.width + ix, mode="clip")
        found &= (ix >= 0) & (iy >= 0) & (ix < i.width) & (iy < i.height)
        return found

    def mark_near(self, points: Array, radius: float) -> Mask:
        """Cells whose centre lies within a radius [m] of any point, shape (N, 2)."""
        hit = np.zeros(self.info.shape, bool)
        ix, iy, inside = self.indices(points[:, 0], points[:, 1])
        hit[iy[inside], ix[inside]] = True
        return grown(hit, math.ceil(radius / self.info.resolution - 0.5))

    def hideouts(self, unseen: Mask, radius: float) -> Mask:
        """Unseen floor where somebody of a radius [m] could stand of whom less than half was seen."""
        cells = max(round(radius / self.info.resolution), 0)
        stands = self.free & ~grown(~self.free, cells)
        hidden = stands & (2 * counted(unseen, cells) > counted(self.free, cells))
        return unseen & grown(hidden, cells)


def floor_of(grid: Grid, *, free_below: int = 25, zones: Sequence[Zone] = ()) -> Floor:
    """Make the floor of a map.

    Args:
        grid: occupancy, -1 unknown, 0 free to 100 occupied.
        free_below: largest occupancy of a floor cell.
        zones: that the robot keeps out of: floor, without clearance.

    Raises:
        MapError: the map is turned, or shows no floor.
    """
    grid.info.require_aligned("the patrol's floor")
    is_floor = (grid.cells >= 0) & (grid.cells <= free_below)
    if not is_floor.any():
        raise MapError("the map", "shows no free cell, so that nobody can say what of a room was seen")
    fold = max(1, round(EDGE / grid.info.resolution))
    info, fine, unknown = _cropped(grid.info, is_floor, grid.cells < 0, fold)
    fine_info = replace(info, resolution=grid.info.resolution, width=fine.shape[1], height=fine.shape[0])
    open_to_robot = fine & ~zones_mask(zones, fine_info) if zones else fine
    clearance = _clearance(open_to_robot, CLEARANCE_MOST / grid.info.resolution) * grid.info.resolution
    blocks = (info.height, fold, info.width, fold)
    free = fine.reshape(blocks).mean(axis=(1, 3)) >= 0.5
    coarse = clearance.reshape(blocks).max(axis=(1, 3))
    pockets = _pockets(fine, unknown, grid.info.resolution).reshape(blocks).mean(axis=(1, 3)) >= 0.5
    unmapped = pockets & ~free
    return Floor(info, free | unmapped, np.where(free, coarse, np.where(unmapped, _UNMAPPED, 0.0)), unmapped)


def _pockets(floor: Mask, unknown: Mask, resolution: float) -> Mask:
    """Unknown cells that a person gets to from mapped floor without passing an obstacle, _DEPTH deep at most."""
    body, steps = max(round(_BODY / resolution), 1), round(_DEPTH / resolution)
    rows, columns = np.nonzero(floor)
    inside = np.zeros(floor.shape, bool)  # between the outermost floor of the house, not beyond its walls
    inside[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = True
    room_for_body = ~grown(~(floor | (unknown & inside)), body)
    reached = ~grown(~floor, body)
    for _ in range(steps):
        reached = grown(reached, 1) & room_for_body
    pockets: Mask = grown(reached, body) & unknown & inside
    return pockets


def _cropped(info: GridInfo, is_floor: Mask, is_unknown: Mask, fold: int) -> tuple[GridInfo, Mask, Mask]:
    """Coarse grid around the floor, and the fine cells under it: which are floor, and which are unknown."""
    margin = math.ceil(_MARGIN / info.resolution)
    rows, columns = np.flatnonzero(is_floor.any(axis=1)), np.flatnonzero(is_floor.any(axis=0))
    y0, x0 = int(rows[0]) - margin, int(columns[0]) - margin
    height = math.ceil((int(rows[-1]) + 1 + margin - y0) / fold)
    width = math.ceil((int(columns[-1]) + 1 + margin - x0) / fold)
    fine, unknown = np.zeros((2, height * fold, width * fold), bool)
    into_y, into_x = max(-y0, 0), max(-x0, 0)
    for whole, cells in ((is_floor, fine), (is_unknown, unknown)):
        part = whole[max(y0, 0) : y0 + height * fold, max(x0, 0) : x0 + width * fold]
        cells[into_y : into_y + part.shape[0], into_x : into_x + part.shape[1]] = part
    coarse = GridInfo(
        resolution=info.resolution * fold,
        width=width,
        height=height,
        origin_x=info.origin_x + x0 * info.resolution,
        origin_y=info.origin_y + y0 * info.resolution,
    )
    return coarse, fine, unknown


def _clearance(free: Mask, most: float) -> Array:
    """Distance from each free cell to the nearest other one [cells], exact up to `most`.

    Columns first, then rows: the two passes of Felzenszwalb and Huttenlocher's distance transform, the second one over
    the shifts that the bound allows.
    """
    reach = math.ceil(most)
    down = _run_lengths(free)
    up = _run_lengths(free[::-1])[::-1]
    column = np.minimum(np.minimum(down, up), reach + 1).astype(np.float64) ** 2
    best = column.copy()
    for shift in range(1, reach + 1):
        best[:, shift:] = np.minimum(best[:, shift:], column[:, :-shift] + shift * shift)
        best[:, :-shift] = np.minimum(best[:, :-shift], column[:, shift:] + shift * shift)
    out: Array = np.minimum(np.sqrt(best), most)
    return out


def _run_lengths(free: Mask) -> NDArray[np.int64]:
    """Number of consecutive free cells ending at each cell, from row 0 on."""
    out = np.zeros(free.shape, np.int64)
    count = np.zeros(free.shape[1], np.int64)
    for row, is_free in enumerate(free):
        count = (count + 1) * is_free
        out[row] = count
    return out
