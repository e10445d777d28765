"""Where to look from next, so that the floor of a room that is not yet seen comes into view.

Next best view (Connolly 1985; for coverage by a ground robot Gonzalez-Banos and Latombe 2002): of the places that the
robot can reach in the room and at its doors, the one that shows most unseen floor for each metre of way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D, wrap_angles
from rosbot_patrol.maps.ways import steps_over
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Array, Floor, Mask
from rosbot_patrol.patrol.visibility.coverage import CoverageParams, sight_on_map, visible

_FAR = math.inf
_ROOMY = 0.6  # so far from all that the map shows nothing low that it does not show is met: the feet of a chair [m]
_TIGHT = 0.8  # what a viewpoint nearer to things is worth against one that is not
_STEP = 0.2  # from so far aside a picture differs [m]
_STEPS = 2.0  # from so many times the spacing of the viewpoints it differs well
_IN_VAIN = 2  # viewpoints on another side that showed nothing are enough
_NEARER = 0.7  # where there is no other side, so much nearer than before is a second look


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
        doc="radius of unseen floor that could hide a person, searched even at coverage_goal; 0: none",
    )
    viewpoint_clearance: float = param(
        0.35, unit="m", lo=0.1, doc="minimum distance from a viewpoint to obstacles, so that the robot can turn"
    )
    passage_clearance: float = param(
        0.22, unit="m", lo=0.05, doc="half the width of the narrowest gap on a route to a viewpoint"
    )
    viewpoint_spacing: float = param(0.4, unit="m", lo=0.1, doc="grid spacing of candidate viewpoints")
    other_side: float = param(
        0.8,
        unit="rad",
        lo=0.0,
        hi=3.1,
        doc="minimum change of viewing direction for a second look at something like a person",
    )
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

    def view_of(
        self,
        start: Pose2D,
        x: float,
        y: float,
        *,
        stands: Mask | None = None,
        seen_from: Sequence[Pose2D] = (),
        tried: Sequence[tuple[float, float]] = (),
        nearest: float = 1.5,
        most: float = 3.5,
    ) -> Viewpoint | None:
        """The nearest viewpoint with a free line to a place, None if there is none.

        Args:
            start: where the robot is, in map.
            x: of the place [m].
            y: of the place [m].
            stands: as for `next`.
            seen_from: poses that showed it: the viewpoint shows another side, or at least more, or a step aside.
            tried: viewpoints that were in vain; after two of them a step aside is enough.
            nearest: minimum distance from the place [m].
            most: maximum distance [m].
        """
        floor, ways = self.floor, self.ways(start, stands)
        sight = sight_on_map(floor, *self._before(x, y), most)
        there = np.ones(floor.info.shape, bool)
        bearings, distances, _ = visible(floor, there, sight, self._coverage)
        open_ = (sight.reaches(bearings, distances) & (distances >= nearest) & (distances <= most)).reshape(there.shape)
        good = open_ & (floor.clearance >= self.params.viewpoint_clearance) & (ways < _FAR)
        if stands is not None:
            good &= ~stands
        untried = good & ~floor.mark_near(np.array(tried), self.params.viewpoint_spacing) if tried else good
        if seen_from:
            good = self._anew(good, untried, distances.reshape(good.shape), seen_from, x=x, y=y, tried=tried)
        else:
            good = untried
        return self._nearest_view(good, ways, x, y) if good.any() else None

    def _nearest_view(self, good: Mask, ways: Array, x: float, y: float) -> Viewpoint:
        """The view of a place from the good cell with the shortest way, a roomy one if there is any."""
        roomy = good & (self.floor.clearance >= _ROOMY)
        good = roomy if roomy.any() else good
        iy, ix = np.unravel_index(int(np.where(good, ways, _FAR).argmin()), good.shape)
        at = self.floor.info.centre_of(int(ix), int(iy))
        yaw = math.atan2(y - at[1], x - at[0])
        return Viewpoint(pose=Pose2D(*at, yaw), turn=0.0, gain=0.0, way=float(ways[iy, ix]))

    def _is_tight(self, x: float, y: float) -> bool:
        ix, iy = self.floor.info.cell_of(x, y)
        return bool(self.floor.clearance[iy, ix] < _ROOMY)

    def _anew(
        self,
        good: Mask,
        untried: Mask,
        distances: Array,
        eyes: Sequence[Pose2D],
        *,
        x: float,
        y: float,
        tried: Sequence[tuple[float, float]],
    ) -> Mask:
        """Of some floor what shows another side of a place than some poses; else more of it; else from a step away.

        A detector that is unsure of one picture is often sure of the next, taken from a step away.
        """
        before = min(math.hypot(eye.x - x, eye.y - y) for eye in eyes)
        choices = untried & self._is_aside_of_all(eyes, x, y), untried & (distances <= _NEARER * before)
        if len(tried) < _IN_VAIN:
            for found in choices:
                if found.any():
                    return found
        return self._a_step_from([*(eye[:2] for eye in eyes), *tried], good)

    def _a_step_from(self, places: Sequence[tuple[float, float]], good: Mask) -> Mask:
        """Of some floor what lies well away from some places, or as far as there is, which may be too little."""
        xs, ys = self.floor.centres(*np.meshgrid(np.arange(good.shape[1]), np.arange(good.shape[0])))
        off = np.min([np.hypot(xs - from_x, ys - from_y) for from_x, from_y in places], axis=0)
        farthest = float(off[good].max(initial=0.0))
        step = min(_STEPS * self.params.viewpoint_spacing, farthest)
        return good & (off >= step) if step >= _STEP else np.zeros_like(good)

    def _is_aside_of_all(self, eyes: Sequence[Pose2D], x: float, y: float) -> Mask:
        """The floor from which a place shows another side than from any of some poses."""
        sides = [self._is_aside(math.atan2(eye.y - y, eye.x - x), x, y) for eye in eyes]
        mask: Mask = np.logical_and.reduce(sides)
        return mask

    def _is_aside(self, bearing: float, x: float, y: float) -> Mask:
        """The floor that lies in another direction from a place than a bearing in map [rad]."""
        ix, iy = np.meshgrid(np.arange(self.floor.info.shape[1]), np.arange(self.floor.info.shape[0]))
        xs, ys = self.floor.centres(ix, iy)
        mask: Mask = np.abs(wrap_angles(np.arctan2(ys - y, xs - x) - bearing)) > self.params.other_side
        return mask

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
        """Length of the way from a pose to each cell [m], _FAR where the robot does not get."""
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
