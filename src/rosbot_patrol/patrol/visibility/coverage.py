"""What share of a room's floor was seen: by the pictures that the detector looked at, as far as nothing stood before.

A cell counts as seen once `seen_in` such pictures had it in view, so that somebody standing there would have been
confirmed. In view means: within the camera's field of view, no farther than the detector tells a person, and reached by
a straight line at the height of lidar and camera (they lie within centimetres of each other on such robots). The line
is broken by what the lidar hits; where a beam comes back from nothing, or there is no lidar, by the map.

Over low things a camera sees somebody who stands behind them, so that this share is rather too small than too great.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, wrap_angles
from rosbot_patrol.maps.raster import grown
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Array, Floor, Mask
from rosbot_patrol.patrol.records.inputs import Eye as Eye
from rosbot_patrol.patrol.records.inputs import ScanView
from rosbot_patrol.scan import LaserScan

_FRAY = (
    0.3  # where the lidar looks farther than the map's wall, it is believed by so much: walls, poses are not exact [m]
)
_WIDTH = 0.02  # between two bearings of a view from the map [rad]
_BETWEEN = np.linspace(0.0, 1.0, 16)  # shares of a line that is looked along on the map


@dataclass(frozen=True, kw_only=True)
class CoverageParams:
    """Conditions under which a piece of floor counts as seen."""

    view_range: float = param(
        8.0, unit="m", lo=0.5, doc="maximum range at which the detector recognises a person reliably"
    )
    view_near: float = param(
        0.5, unit="m", lo=0.0, doc="floor within this distance of the robot always counts as in view"
    )
    view_edge: float = param(
        0.03, unit="rad", lo=0.0, hi=0.5, doc="margin at the left and right image border that does not count"
    )
    view_slack: float = param(
        0.15,
        unit="m",
        lo=0.0,
        hi=1.0,
        doc="floor this close behind an obstacle still counts: half of a person shows there",
    )
    seen_in: int = param(
        3, lo=1, hi=100, doc="number of images in which a piece of floor must be in view to count as seen"
    )


@dataclass(frozen=True)
class Sight:
    """How far one can look from a place.

    Attributes:
        x, y: of the eye [m], in map.
        first: bearing of the first length in map [rad]; step: to the next, counter-clockwise if positive [rad].
        lengths: free way [m], shape (N,).
    """

    x: float
    y: float
    first: float
    step: float
    lengths: Array

    def reaches(self, bearings: Array, distances: Array) -> Mask:
        """Which places, by bearing in map and distance, have a free line to them; False where no beam looks there."""
        found: Mask = distances <= self.towards(bearings)
        return found

    def towards(self, bearings: Array) -> Array:
        """Free way at bearings in map [m], -inf where no beam looks there."""
        turn = (bearings - self.first) * math.copysign(1.0, self.step) % math.tau
        beams = np.rint(turn / abs(self.step)).astype(np.int64)
        whole = round(math.tau / abs(self.step))
        beams = np.where(beams >= whole, beams - whole, beams)
        known = beams < len(self.lengths)
        return np.where(known, self.lengths[np.where(known, beams, 0)], -math.inf)


def sight_on_map(floor: Floor, x: float, y: float, reach: float) -> Sight:
    """How far one can look all around by the map alone.

    Args:
        floor: free space of the map.
        x: of the eye [m].
        y: of the eye [m].
        reach: upper limit of the lengths [m].
    """
    count = math.ceil(math.tau / _WIDTH)
    step = math.tau / count
    bearings = step * np.arange(count)
    along = np.arange(1, math.ceil(reach / floor.info.resolution) + 1) * floor.info.resolution
    stopped = ~floor.are_free(
        x + np.cos(bearings)[:, None] * along[None, :], y + np.sin(bearings)[:, None] * along[None, :]
    )
    lengths = np.where(stopped.any(axis=1), along[stopped.argmax(axis=1)], reach)
    return Sight(x, y, 0.0, step, lengths)


def sight_of_scan(scan: LaserScan, map_from_laser: Pose2D, floor: Floor, reach: float) -> Sight:
    """How far one can look by a scan; a beam that measures nothing reaches as far as the map lets it."""
    at = map_from_laser
    by_map = sight_on_map(floor, at.x, at.y, reach)
    turned = (at.yaw + scan.angles - by_map.first) % math.tau
    walls = by_map.lengths[np.rint(turned / by_map.step).astype(np.int64) % len(by_map.lengths)]
    lengths = np.where(scan.is_hit, np.minimum(np.where(scan.is_hit, scan.ranges, 0.0), walls + _FRAY), walls)
    return Sight(at.x, at.y, at.yaw + scan.angle_min, scan.angle_increment, np.minimum(lengths, reach))


def free_way(floor: Floor, view: ScanView | None, eye: Eye, reach: float) -> Sight:
    """How far one can look from a camera: by the scan, or by the map if there is none."""
    if view is None:
        return sight_on_map(floor, eye.pose.x, eye.pose.y, reach)
    return sight_of_scan(view.scan, view.map_from_laser, floor, reach)


class Coverage:
    """How much of one room was seen.

    Args:
        floor: of the map.
        room: the room's floor.
        params: what counts.
    """

    def __init__(self, floor: Floor, room: Mask, params: CoverageParams | None = None) -> None:
        self.floor, self.params = floor, params or CoverageParams()
        self._iy, self._ix = np.nonzero(room)
        self._x, self._y = floor.centres(self._ix, self._iy)
        self._seen = np.zeros(len(self._x), np.int32)
        self._seen_at = np.full(len(self._x), -math.inf)
        self._left = np.arange(len(self._x))
        self._gone = np.zeros(len(self._x), bool)
        self._unmapped = floor.unmapped[self._iy, self._ix]
        self._beside_unmapped = grown(floor.unmapped, 1)
        self._whole = len(self._x)

    @property
    def share(self) -> float:
        """Of the room's floor that was seen, 0 to 1; 0 where the room has none."""
        floor = int((~self._gone).sum())
        return 0.0 if not floor else 1.0 - int((~self._gone[self._left]).sum()) / floor

    @property
    def area(self) -> float:
        """Of the room [m^2]."""
        return self._whole * self.floor.cell_area

    def look(self, eye: Eye, sight: Sight, at: float = 0.0) -> None:
        """Take one picture that the detector looked at.

        Args:
            eye: the camera when it was taken.
            sight: how far one could look then, from about the same place.
            at: when, of any clock [s]; what was seen often enough keeps the time at which it was.
        """
        p, left = self.params, self._left
        if not len(left):
            return
        dx, dy = self._x[left] - eye.pose.x, self._y[left] - eye.pose.y
        away = np.hypot(dx, dy)
        aside = np.abs(wrap_angles(np.arctan2(dy, dx) - eye.pose.yaw))
        shows = (away <= p.view_range) & (aside <= eye.width / 2.0 - p.view_edge)
        near = left[shows]
        dx, dy = self._x[near] - sight.x, self._y[near] - sight.y
        bearings, free = np.arctan2(dy, dx), np.hypot(dx, dy) - p.view_slack
        reached = sight.reaches(bearings, free)
        self._strike_out(near[~reached], bearings[~reached], sight)
        shows[shows] = reached
        shown = left[shows | (away < p.view_near)]
        self._seen[shown] += 1
        self._seen_at[shown] = at
        self._left = left[self._seen[left] < p.seen_in]

    def _strike_out(self, hidden: NDArray[np.int64], bearings: Array, sight: Sight) -> None:
        """Leave out unmapped floor behind a wall that the lidar meets there and the map does not show."""
        unmapped = self._unmapped[hidden]
        cells, bearings = hidden[unmapped], bearings[unmapped]
        ways = sight.towards(bearings)
        seen = np.isfinite(ways)
        cells, bearings, ways = cells[seen], bearings[seen], ways[seen]
        x, y = sight.x + ways * np.cos(bearings), sight.y + ways * np.sin(bearings)
        ix, iy, inside = self.floor.indices(x, y)
        on_x, on_y = (a[:, None] + (b - a)[:, None] * _BETWEEN for a, b in ((x, self._x[cells]), (y, self._y[cells])))
        is_open = self.floor.are_free(on_x, on_y).all(axis=1)  # by the map one would look on to there
        self._gone[cells[inside & self._beside_unmapped[iy, ix] & is_open]] = True

    def forget(self, before: float) -> None:
        """What was seen before a time [s] is yet to be seen."""
        self._seen[self._seen_at < before] = 0
        self._left = np.flatnonzero(self._seen < self.params.seen_in)

    def stands(self, points: Array) -> None:
        """Leave out floor on which something stands that the map does not show.

        Args:
            points: where the lidar hits, in map [m], shape (N, 2).
        """
        if not len(points):
            return
        hit = self.floor.mark_near(points, 0.0)
        self._gone |= hit[self._iy, self._ix]

    def unseen(self) -> Mask:
        """The room's floor that is yet to be seen, on the floor's grid."""
        out = np.zeros(self.floor.info.shape, bool)
        left = self._left[~self._gone[self._left]]
        out[self._iy[left], self._ix[left]] = True
        return out

    def seen(self) -> Mask:
        """The room's floor that was seen, on the floor's grid."""
        out = np.zeros(self.floor.info.shape, bool)
        out[self._iy, self._ix] = True
        out[self._iy[self._left], self._ix[self._left]] = False
        return out


def bearings_of(floor: Floor, mask: Mask, x: float, y: float) -> tuple[Array, Array]:
    """Bearing in map [rad] and distance [m] of a mask's cells from a place."""
    iy, ix = np.nonzero(mask)
    xs, ys = floor.centres(ix, iy)
    return np.arctan2(ys - y, xs - x), np.hypot(xs - x, ys - y)


def visible(floor: Floor, mask: Mask, sight: Sight, params: CoverageParams) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Bearings and distances of a mask's cells from a sight's eye, and which of them are in view all round."""
    bearings, distances = bearings_of(floor, mask, sight.x, sight.y)
    in_view = (distances <= params.view_range) & sight.reaches(bearings, distances - params.view_slack)
    return bearings, distances, in_view
