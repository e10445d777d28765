"""When each mark of an obstacle layer was last seen, so that what has gone is forgotten."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import LETHAL, CostCells
from rosbot_patrol.costmap.params import SourceParams
from rosbot_patrol.costmap.sources.observation import Observation
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import GridInfo

_PERIOD = 0.2  # between two looks at all marks [s]
_LONGEST = 1.0  # most that one look adds to the time in view [s]
_ROW = 1 << 31  # keys are (iy + half a row) * _ROW + ix + half a row
_HALF = 1 << 30
_BESIDE = 0.6  # what is nearer to the robot's middle may stand where it cannot look again [m]
_MARGIN = 1.5  # a beam passes a cell if it goes on this much behind its centre [cells]

Seen = list[tuple[SourceParams, Observation]]


class MarkMemory:
    """Marked cells with their ages, by places that stay the same while the window moves.

    A mark is seen while a hit falls into its cell. Its place is in view and empty where both beams beside its bearing
    go on behind it, be it to something farther or to nothing at all; it is hidden where one of them ends before.

    Args:
        in_view: a mark is forgotten after so long in view and empty [s], 0 is never.
        out_of_view: a mark is forgotten after so long neither seen nor in view [s], 0 is never.
        beside: the same for a mark right beside the robot [s], 0 is as elsewhere.
    """

    def __init__(self, in_view: float, out_of_view: float, beside: float = 0.0) -> None:
        self._in_view, self._out_of_view = in_view, out_of_view
        self._beside = max(beside, out_of_view)
        self._shift = (0, 0)
        self._next = float("-inf")
        self.clear()

    def clear(self) -> None:
        """Know no mark."""
        self._keys = np.empty(0, np.int64)
        self._empty_for = np.empty(0)
        self._last_view = np.empty(0)

    def __len__(self) -> int:
        return len(self._keys)

    def move(self, dx: int, dy: int) -> None:
        """The window moved by (dx, dy) cells."""
        self._shift = self._shift[0] + dx, self._shift[1] + dy

    def note(self, now: float, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> None:
        """Cells of the window that were hit."""
        keys = np.unique((iy + (self._shift[1] + _HALF)) * _ROW + ix + (self._shift[0] + _HALF))
        at = np.searchsorted(self._keys, keys)
        known = np.zeros(len(keys), bool)
        inside = at < len(self._keys)
        known[inside] = self._keys[at[inside]] == keys[inside]
        self._empty_for[at[known]] = 0.0
        self._last_view[at[known]] = now
        if not known.all():
            where = at[~known]
            self._keys = np.insert(self._keys, where, keys[~known])
            self._empty_for = np.insert(self._empty_for, where, 0.0)
            self._last_view = np.insert(self._last_view, where, now)

    def expired(
        self, now: float, cells: CostCells, info: GridInfo, seen: Seen, robot: Pose2D | None = None
    ) -> NDArray[np.int64]:
        """Cells (ix, iy) of the window to be forgotten, shape (N, 2).

        Args:
            now: time [s]; where it went back all ages start anew.
            cells: the layer's costs; what is not lethal any more is dropped.
            info: the window's place.
            seen: the observations of this update.
            robot: where it stands, in the window's frame, where that matters.
        """
        none = np.empty((0, 2), np.int64)
        if now < self._next - 2.0 * _PERIOD:
            self._last_view[:] = now
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
            longest = np.full(len(at), self._out_of_view)
            if robot is not None:
                x, y = (at + 0.5).T * info.resolution + [[info.origin_x], [info.origin_y]]
                longest[np.hypot(x - robot.x, y - robot.y) < _BESIDE] = self._beside
            old |= now - self._last_view >= longest
        self._keep(~old)
        return at[old]

    def _cells(self) -> NDArray[np.int64]:
        iy, ix = np.divmod(self._keys, _ROW)
        return np.column_stack((ix - (self._shift[0] + _HALF), iy - (self._shift[1] + _HALF)))

    def _keep(self, which: NDArray[np.bool_]) -> None:
        if not which.all():
            self._keys, self._empty_for = self._keys[which], self._empty_for[which]
            self._last_view = self._last_view[which]

    @staticmethod
    def _is_empty(at: NDArray[np.int64], info: GridInfo, seen: Seen) -> NDArray[np.bool_]:
        """Which places the newest scan of a clearing source looks behind."""
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
