"""Ages of an obstacle layer's marks, so that obstacles that have gone are forgotten."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import LETHAL, CostCells
from rosbot_patrol.costmap.sensor_params import SourceParams
from rosbot_patrol.costmap.sources.observation import Observation
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import GridInfo

_PERIOD = 0.2  # time between two checks of all marks [s]
_LONGEST = 1.0  # maximum time in view that one check adds [s]
_LONGEST_KEPT = 600.0  # time out of view after which even what had stood long is forgotten [s]
_ROW = 1 << 31  # keys are (iy + half a row) * _ROW + ix + half a row
_HALF = 1 << 30
_BESIDE = 0.6  # marks nearer to the robot's centre may be where it cannot look again [m]
_MARGIN = 1.5  # a beam passes a cell if it continues this far behind the cell's centre [cells]

Seen = list[tuple[SourceParams, Observation]]


class MarkMemory:
    """Marked cells and their ages, by places that stay the same while the window moves.

    A mark is seen while a hit falls into its cell. Its place is in view and empty if both neighbouring beams continue
    behind it, whether they hit something farther or nothing. It is hidden if one of them ends before it.

    Args:
        in_view: time in view and empty after which a mark is forgotten [s]; 0: never.
        out_of_view: time neither seen nor in view after which a mark is forgotten [s]; 0: never.
        beside: the same for a mark right beside the robot [s]; 0: as elsewhere.
        standing: a mark that was seen for some time is kept out of view for this many times as long, if that is longer
            than `out_of_view`: what has stood will stand, and what passed by has gone.
    """

    def __init__(self, in_view: float, out_of_view: float, beside: float = 0.0, standing: float = 0.0) -> None:
        self._in_view, self._out_of_view, self._standing = in_view, out_of_view, standing
        self._beside = max(beside, out_of_view)
        self._shift = (0, 0)
        self._next = float("-inf")
        self.clear()

    def clear(self) -> None:
        """Forget all marks."""
        self._keys = np.empty(0, np.int64)
        self._empty_for = np.empty(0)
        self._last_view = np.empty(0)
        self._first_hit = np.empty(0)
        self._last_hit = np.empty(0)

    def __len__(self) -> int:
        return len(self._keys)

    def move(self, dx: int, dy: int) -> None:
        """Follow the window, which moved by (dx, dy) cells."""
        self._shift = self._shift[0] + dx, self._shift[1] + dy

    def note(self, now: float, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> None:
        """Record cells of the window that were hit."""
        keys = np.unique((iy + (self._shift[1] + _HALF)) * _ROW + ix + (self._shift[0] + _HALF))
        at = np.searchsorted(self._keys, keys)
        known = np.zeros(len(keys), bool)
        inside = at < len(self._keys)
        known[inside] = self._keys[at[inside]] == keys[inside]
        self._empty_for[at[known]] = 0.0
        self._last_view[at[known]] = now
        self._last_hit[at[known]] = now
        if not known.all():
            where = at[~known]
            self._keys = np.insert(self._keys, where, keys[~known])
            self._empty_for = np.insert(self._empty_for, where, 0.0)
            self._last_view = np.insert(self._last_view, where, now)
            self._first_hit = np.insert(self._first_hit, where, now)
            self._last_hit = np.insert(self._last_hit, where, now)

    def expired(
        self, now: float, cells: CostCells, info: GridInfo, seen: Seen, robot: Pose2D | None = None
    ) -> NDArray[np.int64]:
        """Cells (ix, iy) of the window to forget, shape (N, 2).

        Args:
            now: time [s]; if it went back, all ages start again.
            cells: the layer's costs; cells that are no longer lethal are dropped.
            info: the window's place.
            seen: the observations of this update.
            robot: its place in the window's frame, if `beside` is used.
        """
        none = np.empty((0, 2), np.int64)
        if now < self._next - 2.0 * _PERIOD:
            self._last_view[:] = self._first_hit[:] = self._last_hit[:] = now
            self._next = now
        if now < self._next:
            return none
        passed = min(now - self._next + _PERIOD, _LONGEST)
        self._next = now + _PERIOD
        at = self._cells()
        inside = (at >= 0).all(axis=1) & (at[:, 0] < info.width) & (at[:, 1] < info.height)
        inside[inside] = cells[at[inside, 1], at[inside, 0]] == LETHAL
        self._keep(inside)
        at = at[inside]
        if not len(at):
            return none
        empty = self._is_empty(at, info, seen)
        self._empty_for[empty] += passed
        self._last_view[empty] = now
        old = np.zeros(len(at), bool)
        if self._in_view > 0.0:
            old |= empty & (self._empty_for >= self._in_view)
        if self._out_of_view > 0.0:
            stood = np.minimum(self._standing * (self._last_hit - self._first_hit), _LONGEST_KEPT)
            longest = np.maximum(stood, self._out_of_view)
            if robot is not None:
                x, y = (at + 0.5).T * info.resolution + [[info.origin_x], [info.origin_y]]
                is_beside = np.hypot(x - robot.x, y - robot.y) < _BESIDE
                longest[is_beside] = np.maximum(longest[is_beside], self._beside)
            old |= now - self._last_view >= longest
        self._keep(~old)
        forgotten: NDArray[np.int64] = at[old]
        return forgotten

    def _cells(self) -> NDArray[np.int64]:
        iy, ix = np.divmod(self._keys, _ROW)
        return np.column_stack((ix - (self._shift[0] + _HALF), iy - (self._shift[1] + _HALF)))

    def _keep(self, which: NDArray[np.bool_]) -> None:
        if not which.all():
            self._keys, self._empty_for = self._keys[which], self._empty_for[which]
            self._last_view = self._last_view[which]
            self._first_hit, self._last_hit = self._first_hit[which], self._last_hit[which]

    @staticmethod
    def _is_empty(at: NDArray[np.int64], info: GridInfo, seen: Seen) -> NDArray[np.bool_]:
        """Whether the newest scan of a clearing source looks behind each place, shape (N,)."""
        empty = np.zeros(len(at), bool)
        newest = {id(source): (source, o) for source, o in seen if source.clearing and o.view is not None}
        for source, observation in newest.values():
            assert observation.view is not None
            x = info.origin_x + (at[:, 0] + 0.5) * info.resolution - observation.sensor[0]
            y = info.origin_y + (at[:, 1] + 0.5) * info.resolution - observation.sensor[1]
            distance = np.hypot(x, y)
            free = observation.view.free_to(np.arctan2(y, x))
            empty |= (distance < source.raytrace_range) & (free > distance + _MARGIN * info.resolution)
        return empty
