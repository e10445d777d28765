"""Maps of all particles: grids of 16 x 16 tiles, shared until a particle writes (copy on write)."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import MapError
from rosbot_patrol.gmapping import tile_kernels as kernels
from rosbot_patrol.gmapping.beams import Beams
from rosbot_patrol.gmapping.tile_kernels import AREA, FIELDS, FULL, HITS, MEAN_X, MEAN_Y, ROWS, TILE, VISITS, WALLS
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.occupancy import FREE, OCCUPIED, UNKNOWN

Array = NDArray[np.float64]

PATCH = 32  # cells: upstream rounds the initial extent down to a multiple of this
MARGIN = 10.0  # m by which a map grows
GROWTH = 1.25
SEED_BEAMS = 5  # number of beams that a cell of a saved map stands for
RECENT = 100  # beams of a cell that count on a saved map: what moved since is forgotten where the lidar looks through


class ParticleMaps:
    """One map for each particle.

    Args:
        lows: lower left corner of the initial extent [m].
        highs: upper right corner [m].
        resolution: edge of a cell [m].
        count: number of particles.

    Raises:
        MapError: the extent is invalid.
    """

    def __init__(self, lows: tuple[float, float], highs: tuple[float, float], resolution: float, count: int) -> None:
        sizes = [(high - low) / resolution for low, high in zip(lows, highs, strict=True)]
        if not all(math.isfinite(size) and 1.0 <= size <= 1e5 for size in sizes):
            raise MapError(
                "map",
                f"an extent from {lows} to {highs} m is invalid, expected xmin < xmax and ymin < ymax,"
                " 100000 cells at most to a side",
            )
        self.resolution = resolution
        self.origin = np.array(lows, dtype=np.float64)
        columns, rows = (max(int(size) // PATCH, 1) * PATCH // TILE for size in sizes)
        self.tables = np.full((count, rows, columns), -1, dtype=np.int32)
        self.cells = np.zeros((0, ROWS, FIELDS), dtype=np.uint16)
        self.refs = np.zeros(0, dtype=np.int32)
        self.free = np.zeros(1, dtype=np.int32)
        self._scans = 0  # number of the last scan, 1 to 65535
        self._most = FULL  # beams of a cell at which its counts are halved

    @property
    def count(self) -> int:
        """Number of maps."""
        return len(self.tables)

    @property
    def tiles_used(self) -> int:
        """Number of tiles in use."""
        return len(self.refs) - int(self.free[0])

    @property
    def megabytes(self) -> float:
        """Memory of all maps together [MB]."""
        return (self.tables.nbytes + self.cells.nbytes + self.refs.nbytes + self.free.nbytes) / 1e6

    @property
    def info(self) -> GridInfo:
        """Place and size of the maps."""
        _, rows, columns = self.tables.shape
        return GridInfo(
            resolution=self.resolution,
            width=columns * TILE,
            height=rows * TILE,
            origin_x=float(self.origin[0]),
            origin_y=float(self.origin[1]),
        )

    def to_cells(self, poses: Array) -> Array:
        """Convert poses to cells from the lower left corner, shape (N, 3)."""
        moved = np.array(poses, dtype=np.float64)
        moved[:, :2] = (moved[:, :2] - self.origin) / self.resolution
        return moved

    def from_cells(self, poses: Array) -> Array:
        """Convert poses from cells to metres, shape (N, 3)."""
        moved = np.array(poses, dtype=np.float64)
        moved[:, :2] = moved[:, :2] * self.resolution + self.origin
        return moved

    def register(self, poses: Array, beams: Beams) -> None:
        """Write a scan into each map, seen from its particle's pose; poses of shape (N, 3) [m, rad]."""
        self._cover(poses, beams.reach)
        placed = self.to_cells(poses)
        self._scans = self._scans % FULL + 1
        for table, (x, y, yaw) in zip(self.tables, placed, strict=True):
            c, s = math.cos(yaw), math.sin(yaw)
            turn = np.array([[c, s], [-s, c]]) / self.resolution
            ends = beams.ends @ turn + (x, y)
            self.write(table, beams.sensor @ turn + (x, y), ends, beams.is_hit)

    def draw_anew(self, poses: Array, scans: Iterable[Beams], saved: Grid | None = None) -> None:
        """Replace all maps by one, drawn from scans at poses of shape (S, 3) [m, rad], on top of a saved one."""
        count = self.count
        self.tables = np.full((1, *self.tables.shape[1:]), -1, dtype=np.int32)
        kernels.count_references(self.tables, self.refs, self.free)
        if saved is not None:
            self.seed(saved)
        for pose, beams in zip(poses, scans, strict=True):
            self.register(pose[None], beams)
        self.select(np.zeros(count, dtype=np.int64))

    def write(self, table: NDArray[np.int32], start: Array, ends: Array, is_hit: NDArray[np.bool_]) -> None:
        """Write one scan into one map.

        Args:
            table: of the map.
            start: the sensor [cells], shape (2,).
            ends: of the beams [cells], shape (K, 2).
            is_hit: whether the beams hit something there, shape (K,).
        """
        arrays = (table, self.cells, self.refs, self.free)
        done, stamp = 0, self._scans
        while (done := kernels.register_hits(*arrays, ends, is_hit, stamp, done, self._most)) < len(ends):
            self._grow(0)
        done = 0
        while (done := kernels.register_rays(*arrays, start, ends, stamp, done, self._most)) < len(ends):
            self._grow(int(np.abs(ends - start).sum(axis=1).max()) // TILE + 4)

    def _grow(self, least: int) -> None:
        """Add unused tiles."""
        old, unused = len(self.refs), int(self.free[0])
        new = int(old * GROWTH) + max(least, 256)
        self.cells.resize((new, ROWS, FIELDS), refcheck=False)  # in place if the system can
        self.refs.resize(new, refcheck=False)
        self.free.resize(new + 1, refcheck=False)
        self.free[1 + unused : 1 + unused + new - old] = np.arange(new - 1, old - 1, -1)
        self.free[0] = unused + new - old

    def _cover(self, poses: Array, reach: float) -> None:
        """Grow the tables so that they cover scans from these poses."""
        _, rows, columns = self.tables.shape
        edge = TILE * self.resolution
        far = reach + 2.0 * self.resolution
        low = np.floor((poses[:, :2].min(axis=0) - far - self.origin) / edge)
        high = np.floor((poses[:, :2].max(axis=0) + far - self.origin) / edge)
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            raise MapError("map", "a pose is not finite")
        margin = math.ceil(MARGIN / edge)
        before = [int(margin - v) if v < 0 else 0 for v in low]
        after = [int(v - size + 1 + margin) if v >= size else 0 for v, size in zip(high, (columns, rows), strict=True)]
        if any(before) or any(after):
            pads = ((0, 0), (before[1], after[1]), (before[0], after[0]))
            self.tables = np.pad(self.tables, pads, constant_values=-1)
            self.origin = self.origin - np.array(before) * edge

    def select(self, indices: NDArray[np.int64]) -> None:
        """Keep the maps of these particles, some of them several times, and drop the others."""
        self.tables = np.ascontiguousarray(self.tables[indices])
        kernels.count_references(self.tables, self.refs, self.free)

    def walls(self, index: int, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which cells of a map are walls in matching, in its tiles from x, y `low` to before `high`, 16 cells each."""
        table = self.tables[index, low[1] : high[1], low[0] : high[0]]
        rows = np.where(table[..., None] >= 0, self.cells[table, AREA:, WALLS], 0)  # bits, shape (TY, TX, 16)
        walls = (rows[..., None] >> np.arange(TILE)) & 1
        return np.ascontiguousarray(walls.swapaxes(1, 2).reshape(len(table) * TILE, -1) > 0)

    def grid(self, index: int, threshold: float) -> Grid:
        """One map as int8 cells: 100 if more than `threshold` of the beams ended there, 0 if fewer, -1 unknown."""
        info = self.info
        out = np.empty(info.shape, dtype=np.int8)
        kernels.render(self.tables[index], self.cells, threshold, out)
        return Grid(info, out)

    def seed(self, grid: Grid) -> None:
        """Initialise all maps with a saved one.

        Raises:
            MapError: it is turned, or its cells are of another size.
        """
        grid.info.require_aligned("slam_gmapping")
        self._most = RECENT
        if abs(grid.info.resolution / self.resolution - 1.0) > 1e-3:
            raise MapError("map", f"its cells are {grid.info.resolution} m, expected delta, {self.resolution} m")
        edge = TILE * self.resolution
        corner = np.array([grid.info.origin_x, grid.info.origin_y])
        first = np.floor((corner - self.origin) / edge + 1e-6)
        self.origin = corner - first * edge  # a whole number of tiles from the saved map's corner
        centre = corner + 0.5 * np.array(grid.info.size)
        self._cover(np.array([[*centre, 0.0]]), 0.5 * max(grid.info.size))
        tx, ty = np.rint((corner - self.origin) / edge).astype(int)
        height, width = (-(-n // TILE) * TILE for n in grid.cells.shape)
        cells = np.full((height, width), UNKNOWN, dtype=np.int8)
        cells[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
        blocks = cells.reshape(height // TILE, TILE, width // TILE, TILE).swapaxes(1, 2).reshape(-1, AREA)
        shown = np.flatnonzero((blocks != UNKNOWN).any(axis=1))
        self._grow(len(shown))
        tiles = self.free[int(self.free[0]) - np.arange(len(shown))]
        ys, xs = np.divmod(shown, width // TILE)
        self.tables[:, ty + ys, tx + xs] = tiles
        known = blocks[shown]
        self.cells[tiles] = 0
        self.cells[tiles, :AREA, VISITS] = np.where((known == FREE) | (known == OCCUPIED), SEED_BEAMS, 0)
        self.cells[tiles, :AREA, HITS] = np.where(known == OCCUPIED, SEED_BEAMS, 0)
        self.cells[tiles, :AREA, MEAN_X] = self.cells[tiles, :AREA, MEAN_Y] = FULL // 2
        walls = (known == OCCUPIED).reshape(-1, TILE, TILE)
        self.cells[tiles, AREA:, WALLS] = walls @ (1 << np.arange(TILE))
        kernels.count_references(self.tables, self.refs, self.free)
