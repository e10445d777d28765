"""Where to look from next, so that the floor of a room that is not yet seen comes into view.

Next best view (Connolly 1985; for coverage by a ground robot Gonzalez-Banos and Latombe 2002): of the places that the
robot can reach in the room and at its doors, the one that shows most unseen floor for each metre of way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.ways import steps_over
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Array, Floor, Mask
from rosbot_patrol.patrol.visibility.coverage import CoverageParams, sight_on_map, visible

_FAR = math.inf
_ROOMY = 0.6  # [m] clearance from mapped obstacles that also avoids unmapped low ones, such as the feet of a chair
_TIGHT = 0.8  # weight of a viewpoint with less clearance
_SECTOR = 0.4  # [rad] width of a direction of second looks
_RING = 1.0  # [m] likewise of a distance


@dataclass(frozen=True, kw_only=True)
class ViewpointParams:
    """Limits of further viewpoints, and the gain that makes one worth the drive."""

    coverage_goal: float = param(0.95, lo=0.0, hi=1.0, doc="share of the room's floor to be seen")
    viewpoints_most: int = param(4, lo=0, hi=50, doc="maximum number of further viewpoints in one mission")
    second_looks_most: int = param(
        8,
        lo=0,
        hi=50,
        doc="maximum number of additional viewpoints for something that looks like a person",
    )
    viewpoints_time: float = param(150.0, unit="s", lo=0.0, doc="time after which no further viewpoint is started")
    look_again: bool = param(
        True,
        doc="if nobody was found but sensor or lidar noticed motion, search once more what was seen before it",
    )
    viewpoint_gain: float = param(
        0.01, lo=0.0, hi=1.0, doc="minimum share of the floor that a viewpoint must newly show"
    )
    hideout: float = param(
        0.2,
        unit="m",
        lo=0.0,
        hi=2.0,
        doc="radius of a person; where half of one could hide, it searches even at coverage_goal; 0: nowhere",
    )
    viewpoint_clearance: float = param(
        0.35, unit="m", lo=0.1, doc="minimum distance from a viewpoint to obstacles, so that the robot can turn"
    )
    passage_clearance: float = param(
        0.22, unit="m", lo=0.05, doc="half the width of the narrowest gap on a route to a viewpoint"
    )
    viewpoint_spacing: float = param(0.4, unit="m", lo=0.1, doc="grid spacing of candidate viewpoints")
    doorway_depth: float = param(1.0, unit="m", lo=0.0, doc="maximum distance of a viewpoint outside the room")


@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """A place to look from.

    Attributes:
        pose: in map, heading where the turn begins.
        turn: to the left from there [rad], 0 where one look ahead is enough.
        gain: unseen floor that it shows [m^2].
        way: to it [m].
        stay: longer than elsewhere, as what was there may come and go [s].
    """

    pose: Pose2D
    turn: float
    gain: float
    way: float
    stay: float = 0.0


class ViewpointPlanner:
    """Plans viewpoints on one floor.

    Args:
        floor: of the map.
        params: of viewpoints.
        coverage: what counts as seen.
    """

    def __init__(
        self, floor: Floor, params: ViewpointParams | None = None, coverage: CoverageParams | None = None
    ) -> None:
        self.floor, self.params = floor, params or ViewpointParams()
        self._coverage = coverage or CoverageParams()

    def next(
        self,
        start: Pose2D,
        room: Mask,
        unseen: Mask,
        *,
        width: float,
        stands: Mask | None = None,
        tried: tuple[tuple[float, float], ...] = (),
        least: float | None = None,
    ) -> Viewpoint | None:
        """The best further viewpoint, None where none is worth its way.

        Args:
            start: where the robot is, in map.
            room: the room's floor.
            unseen: its part that is not yet seen.
            width: of the camera's view [rad].
            stands: cells on which something stands that the map does not show, grown by the robot's radius.
            tried: places [m] that could not be reached; their surroundings are left out.
            least: floor that it must show anew [m2], None for the share of the room that the parameters ask for.
        """
        ways = self.ways(start, stands)
        places = self._places(room, ways, stands, tried)
        share = self.params.viewpoint_gain * int(room.sum())
        fewest = max(share if least is None else least / self.floor.cell_area, 1.0)
        best: tuple[float, float, float, float, int] | None = None
        for x, y, way in places:
            sight = sight_on_map(self.floor, x, y, self._coverage.view_range)
            shown = int(visible(self.floor, unseen, sight, self._coverage)[2].sum())
            worth = shown / (way + 1.5)  # a turn costs as much as a metre and a half
            if self._is_tight(x, y):
                worth *= _TIGHT
            if shown >= fewest and (best is None or worth > best[0]):
                best = worth, x, y, way, shown
        if best is None:
            return None
        _, x, y, way, most = best
        first, turn = self.arc(x, y, unseen, width)
        return Viewpoint(pose=Pose2D(x, y, first), turn=turn, gain=most * self.floor.cell_area, way=way)

    def fallback(
        self, start: Pose2D, room: Mask, *, tried: tuple[tuple[float, float], ...], width: float
    ) -> Viewpoint | None:
        """Another place to look into a room from whose own point cannot be reached."""
        return self.next(start, room, room, width=width, tried=tried)

    def views_of(
        self,
        start: Pose2D,
        x: float,
        y: float,
        *,
        stands: Mask | None = None,
        tried: Sequence[tuple[float, float]] = (),
        nearest: float = 1.0,
        most: float = 4.5,
    ) -> list[Viewpoint]:
        """Viewpoints with a free line to a place, from each direction and distance the one with the shortest way.

        Args:
            start: where the robot is, in map.
            x: of the place [m].
            y: of the place [m].
            stands: as for `next`.
            tried: viewpoints that were chosen before; their surroundings are left out.
            nearest: minimum distance from the place [m].
            most: maximum distance [m].
        """
        floor, ways = self.floor, self.ways(start, stands)
        sight = sight_on_map(floor, *self._before(x, y), most)
        bearings, distances, _ = visible(floor, np.ones(floor.info.shape, bool), sight, self._coverage)
        open_ = sight.reaches(bearings, distances) & (distances >= nearest) & (distances <= most)
        good = open_.reshape(ways.shape) & (floor.clearance >= self.params.viewpoint_clearance) & (ways < _FAR)
        if stands is not None:
            good &= ~stands
        if tried:
            good &= ~floor.mark_near(np.array(tried), self.params.viewpoint_spacing)
        iy, ix = np.nonzero(good)
        if not len(iy):
            return []
        sectors = np.floor(bearings.reshape(good.shape)[good] / _SECTOR).astype(np.int64)
        rings = np.floor(distances.reshape(good.shape)[good] / _RING).astype(np.int64)
        costs = ways[good] / np.where(floor.clearance[good] >= _ROOMY, 1.0, _TIGHT)
        order = np.argsort(costs, kind="stable")
        _, first = np.unique(np.stack((sectors[order], rings[order])), axis=1, return_index=True)
        return [self._facing(int(ix[k]), int(iy[k]), x, y, float(ways[iy[k], ix[k]])) for k in order[first]]

    def _facing(self, ix: int, iy: int, x: float, y: float, way: float) -> Viewpoint:
        at = self.floor.info.centre_of(ix, iy)
        return Viewpoint(pose=Pose2D(*at, math.atan2(y - at[1], x - at[0])), turn=0.0, gain=0.0, way=way)

    def _is_tight(self, x: float, y: float) -> bool:
        ix, iy = self.floor.info.cell_of(x, y)
        return bool(self.floor.clearance[iy, ix] < _ROOMY)

    def _before(self, x: float, y: float) -> tuple[float, float]:
        """The floor before a wall on which something hangs."""
        cell = self.floor.nearest(self.floor.clearance >= 0.15, x, y)
        return (x, y) if cell is None else self.floor.info.centre_of(*cell)

    def arc(self, x: float, y: float, unseen: Mask, width: float) -> tuple[float, float]:
        """Heading at which to begin [rad] and how far to turn left [rad], to have all unseen floor in view from there.

        The turn is a whole one where unseen floor lies all round.
        """
        sight = sight_on_map(self.floor, x, y, self._coverage.view_range)
        bearings, _, in_view = visible(self.floor, unseen, sight, self._coverage)
        bearings = np.sort(bearings[in_view])
        if not len(bearings):
            return 0.0, math.tau
        gaps = np.diff(bearings, append=bearings[0] + math.tau)
        k = int(gaps.argmax())
        first, span = float(bearings[(k + 1) % len(bearings)]), math.tau - float(gaps[k])
        inner = 0.6 * width  # the outer fifths of the picture are for what the heading is off by
        if span <= inner:
            return math.remainder(first + span / 2.0, math.tau), 0.0
        turn = span - inner
        if turn > math.tau - width:
            return math.remainder(first, math.tau), math.tau
        return math.remainder(first + inner / 2.0, math.tau), turn

    def ways(self, start: Pose2D, stands: Mask | None = None) -> Array:
        """Length of the way from a pose to each cell [m], _FAR where the robot cannot reach."""
        wide = self.floor.clearance >= self.params.passage_clearance
        if stands is not None:
            wide &= ~stands
        cell = self.floor.nearest(wide, start.x, start.y, 1.0)
        if cell is None:
            return np.full(self.floor.info.shape, _FAR)
        return steps_over(wide, cell) * self.floor.info.resolution

    def reached(self, start: Pose2D) -> Mask:
        """Cells of the floor that the robot gets to from a pose."""
        mask: Mask = self.ways(start) < _FAR
        return mask

    def _places(
        self, room: Mask, ways: Array, stands: Mask | None, tried: tuple[tuple[float, float], ...]
    ) -> list[tuple[float, float, float]]:
        p, floor = self.params, self.floor
        iy, ix = np.nonzero(room)
        if not len(ix):
            return []
        xs, ys = floor.centres(ix, iy)
        inside = floor.mark_near(np.column_stack((xs, ys)), p.doorway_depth)
        good = inside & (floor.clearance >= p.viewpoint_clearance) & (ways < _FAR)
        if stands is not None:
            good &= ~stands
        for x, y in tried:
            good &= ~floor.mark_near(np.array([[x, y]]), p.viewpoint_spacing)
        return [self._place(iy, ix, ways) for iy, ix in self._thinned(good)]

    def _thinned(self, good: Mask) -> list[tuple[int, int]]:
        """Of each square of the spacing, the cell with the greatest clearance."""
        edge = max(round(self.params.viewpoint_spacing / self.floor.info.resolution), 1)
        iy, ix = np.nonzero(good)
        square = (iy // edge) * (good.shape[1] // edge + 1) + ix // edge
        order = np.lexsort((-self.floor.clearance[iy, ix], square))
        _, first = np.unique(square[order], return_index=True)
        return [(int(iy[order[k]]), int(ix[order[k]])) for k in first]

    def _place(self, iy: int, ix: int, ways: Array) -> tuple[float, float, float]:
        x, y = self.floor.info.centre_of(ix, iy)
        return x, y, float(ways[iy, ix])
