"""Frontiers of a map: borders between floor and unknown space, and where to stand to look beyond.

Frontier-based exploration (Yamauchi, A frontier-based approach for autonomous exploration, CIRA 1997); frontiers are
weighed by path length and size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.raster import grown
from rosbot_patrol.maps.ways import steps_over
from rosbot_patrol.params import param

Mask = NDArray[np.bool_]
Array = NDArray[np.float64]

_FREE_BELOW, _WALL_ABOVE = 25, 65  # occupancy, map_server's thresholds
_ROOM = 4.0  # metres of nearness to a frontier that a metre of room around a goal is worth
_REFUSED = 0.4  # radius around a place that was not reached, in which no goal is given [m]


@dataclass(frozen=True, kw_only=True)
class FrontierParams:
    """Frontiers that are worth a drive."""

    robot_radius: float = param(
        0.22, unit="m", lo=0.05, doc="minimum distance of goals and routes from obstacles, above move_base's own"
    )
    frontier_length: float = param(0.5, unit="m", lo=0.05, doc="minimum length of a frontier")
    frontier_clearance: float = param(
        0.12, unit="m", lo=0.0, doc="minimum distance of a frontier from obstacles: beams pass along walls"
    )
    frontier_near: float = param(1.0, unit="m", lo=0.1, doc="maximum distance of a goal from its frontier")
    goal_room: float = param(0.35, unit="m", lo=0.0, doc="distance of goals from obstacles where there is such room")
    frontier_gain: float = param(0.8, lo=0.0, doc="metres of route that a metre of frontier is worth")


@dataclass(frozen=True, kw_only=True)
class Frontier:
    """One frontier.

    Attributes:
        x, y: its centre in map [m].
        length: of it [m].
        goal: where to stand, looking at it.
        way: path length to the goal [m].
        cost: smaller is better.
    """

    x: float
    y: float
    length: float
    goal: Pose2D
    way: float
    cost: float


class Borders:
    """A map and the part of it that the robot can reach.

    Args:
        grid: occupancy, -1 unknown, 0 free to 100 occupied.
        start: of the robot in map.
        params: limits.
        refused: places (x, y) in map that the robot did not reach: no goal is given near them.
        passed: places (x, y) in map where the robot has been, a cell or less apart: it fits through there.
    """

    def __init__(
        self,
        grid: Grid,
        start: Pose2D,
        params: FrontierParams,
        refused: Sequence[tuple[float, float]] = (),
        passed: Sequence[tuple[float, float]] = (),
    ) -> None:
        self._info, self._params, self._refused = grid.info, params, refused
        cells = grid.cells
        self._free = (cells >= 0) & (cells <= _FREE_BELOW)
        self._is_wall = cells >= _WALL_ABOVE
        self._unknown = ~self._free & ~self._is_wall
        self._clearance = _distances(self._is_wall, grid.info.resolution)
        wide = self._free & ((self._clearance >= params.robot_radius) | self._beside(passed))
        self._ways = np.full(cells.shape, math.inf)
        cell = self._nearest(wide, start.x, start.y, 1.0)
        if cell is not None:
            self._ways = steps_over(wide, cell) * grid.info.resolution

    def _beside(self, places: Sequence[tuple[float, float]]) -> Mask:
        """Cells of some places, and those around them."""
        mask = np.zeros(self._free.shape, bool)
        for x, y in places:
            ix, iy = self._info.cell_of(x, y)
            if self._info.contains_cell(ix, iy):
                mask[iy, ix] = True
        return grown(mask, 1)

    @property
    def area(self) -> float:
        """Known floor [m2]."""
        return float(self._free.sum()) * self._info.resolution**2

    def frontiers(self) -> list[Frontier]:
        """Reachable frontiers, the best first."""
        p, beside = self._params, cv2.dilate(self._unknown.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        border = self._free & beside & (self._clearance >= p.frontier_clearance)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(border.astype(np.uint8), connectivity=8)
        found = []
        for k in range(1, count):
            length = float(max(stats[k, cv2.CC_STAT_WIDTH], stats[k, cv2.CC_STAT_HEIGHT])) * self._info.resolution
            if length < p.frontier_length:
                continue
            frontier = self._frontier(np.argwhere(labels == k), length)
            if frontier is not None:
                found.append(frontier)
        return sorted(found, key=lambda f: f.cost)

    def _frontier(self, cells: NDArray[np.intp], length: float) -> Frontier | None:
        iy, ix = cells[int(np.hypot(*(cells - cells.mean(axis=0)).T).argmin())]
        x, y = self._info.centre_of(int(ix), int(iy))
        stand = self._viewpoint(x, y)
        if stand is None:
            return None
        at = self._info.centre_of(*stand)
        way = float(self._ways[stand[1], stand[0]])
        yaw = math.atan2(y - at[1], x - at[0])
        cost = way - self._params.frontier_gain * length
        return Frontier(x=x, y=y, length=length, goal=Pose2D(*at, yaw), way=way, cost=cost)

    def _viewpoint(self, x: float, y: float) -> tuple[int, int] | None:
        """(ix, iy) of the reachable cell near a place from which to look at it, None if there is none.

        In sight of it, away from `refused`, with room around, and near; a metre of room counts for `_ROOM` of nearness.
        """
        p, info = self._params, self._info
        cells, gaps = self._near(np.isfinite(self._ways), x, y, p.frontier_near)
        places = (cells + 0.5) * info.resolution + (info.origin_x, info.origin_y)
        for place in self._refused:
            gaps[np.hypot(*(places - place).T) < _REFUSED] = math.inf
        gaps[~self._sees(cells, x, y)] = math.inf
        if not np.isfinite(gaps).any():
            return None
        tight = np.maximum(p.goal_room - self._clearance[cells[:, 1], cells[:, 0]], 0.0)
        ix, iy = cells[int((gaps + _ROOM * tight).argmin())]
        return int(ix), int(iy)

    def _sees(self, cells: NDArray[np.intp], x: float, y: float) -> Mask:
        """From which cells (ix, iy), shape (K, 2), no wall hides a place; shape (K,)."""
        to = np.array(self._info.cell_of(x, y))
        steps = np.linspace(0.0, 1.0, 2 + 2 * math.ceil(self._params.frontier_near / self._info.resolution))
        between = np.rint(cells[:, None] + (to - cells)[:, None] * steps[None, :, None]).astype(np.intp)
        return ~np.asarray(self._is_wall[between[..., 1], between[..., 0]].any(axis=1))

    def _nearest(self, mask: Mask, x: float, y: float, within: float) -> tuple[int, int] | None:
        """(ix, iy) of the mask's cell nearest to a place, None if there is none within a distance [m]."""
        cells, gaps = self._near(mask, x, y, within)
        if not len(cells):
            return None
        ix, iy = cells[int(gaps.argmin())]
        return int(ix), int(iy)

    def _near(self, mask: Mask, x: float, y: float, within: float) -> tuple[NDArray[np.intp], Array]:
        """The mask's cells (ix, iy) within a distance of a place [m], shape (K, 2), and their distances [m], (K,)."""
        info, reach = self._info, math.ceil(within / self._info.resolution)
        ix, iy = info.cell_of(x, y)
        x0, y0 = max(ix - reach, 0), max(iy - reach, 0)
        part = np.argwhere(mask[y0 : max(iy + reach + 1, 0), x0 : max(ix + reach + 1, 0)])
        cells = part[:, ::-1] + (x0, y0)
        gaps = np.hypot(cells[:, 0] - ix, cells[:, 1] - iy) * info.resolution
        return cells[gaps <= within], gaps[gaps <= within]


def _distances(is_wall: Mask, resolution: float) -> Array:
    """Distance from each cell to the nearest wall [m]."""
    if not is_wall.any():
        return np.full(is_wall.shape, math.inf)
    return np.asarray(cv2.distanceTransform((~is_wall).astype(np.uint8), cv2.DIST_L2, 5), np.float64) * resolution
