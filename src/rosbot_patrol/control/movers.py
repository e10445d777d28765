"""Moving objects around the robot, from lidar scans: people, pets, doors, each with position and velocity.

A beam that ends where beams recently passed has hit something that has moved there (free-space violation, as in Wang,
Thorpe, Thrun 2003). Such points are grouped to objects, objects are tracked from scan to scan, and the slope of a line
through the last positions gives the velocity. An object moves if it has left the place of its first sighting; a chair
leg or a wall's end that comes into view bit by bit has not. An object that stands still for a while becomes an ordinary
obstacle. No map is needed; odometry must hold for `memory` seconds only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, invert, transform_points
from rosbot_patrol.params import param
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

_CELL = 0.1  # [m]
_PERIOD = 0.045  # minimum time between the scans used [s]
_MARGIN = 0.15  # end of a beam that is not counted as free, for noise and odometry drift [m]
_AROUND = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
_VEIL = 0.1  # a beam longer than one neighbour and shorter than the other by this was split by an edge [m]
_MOSTLY = 7  # of the nine cells around a hit must have been free, else it may be the edge of a wall
_SLIPPED = 0.3  # share of new hits above which the odometry has slipped instead
_SIGHTINGS = 3  # minimum number of sightings in the window
_THERE = 0.07  # a beam within this of a point's distance has hit it again: noise and odometry [m]
_SAME = 0.3  # beam ends within this distance belong to the object [m]
_STAYS = 0.7  # share of an object's points that, hit again, show that it is still there
_NEVER = -math.inf


@dataclass(frozen=True, kw_only=True)
class MoverParams:
    """Parameters of the detection of moving objects."""

    reach: float = param(4.0, lo=0.5, hi=20.0, unit="m", doc="maximum range of tracked objects")
    memory: float = param(2.0, lo=0.2, unit="s", doc="time for which a place counts as seen free")
    still_after: float = param(1.2, lo=0.2, unit="s", doc="standstill after which an object no longer counts as moving")
    min_points: int = param(3, lo=1, doc="minimum number of beams on an object")
    gap: float = param(
        0.45, lo=0.05, unit="m", doc="points closer than this belong to one object: two legs, one person"
    )
    jump: float = param(0.6, lo=0.1, unit="m", doc="maximum distance of an object from its predicted position")
    window: float = param(0.7, lo=0.2, unit="s", doc="time span of the positions that give the velocity")
    coast: float = param(0.6, lo=0.0, unit="s", doc="time for which a hidden object is extrapolated")


class Mover(NamedTuple):
    """A moving object in the odometry frame: position [m], velocity [m/s], time since its first sighting [s]."""

    x: float
    y: float
    vx: float
    vy: float
    age: float

    @property
    def speed(self) -> float:
        """[m/s]."""
        return math.hypot(self.vx, self.vy)

    def at(self, seconds: float) -> tuple[float, float]:
        """Predicted position after some time [s]."""
        return self.x + self.vx * seconds, self.y + self.vy * seconds


@dataclass(frozen=True)
class _Thing:
    points: Array

    @property
    def middle(self) -> tuple[float, float]:
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        return float(low[0] + high[0]) / 2.0, float(low[1] + high[1]) / 2.0


@dataclass
class _Track:
    places: list[tuple[float, float, float]] = field(default_factory=list)  # time, x, y
    things: list[_Thing] = field(default_factory=list)  # at these positions
    since: float = 0.0
    moved_at: float = _NEVER

    def add(self, now: float, thing: _Thing, window: float) -> None:
        """Add a sighting; drop those older than the window."""
        self.places.append((now, *thing.middle))
        self.things.append(thing)
        while self.places[0][0] <= now - window:
            del self.places[0], self.things[0]

    def look_back(self, scan: LaserScan, laser_from_odom: Pose2D, now: float) -> None:
        """Note whether the object has left its oldest position: beams continue there, or end at its present one.

        If they end at something else, or there are none, it may still be there.
        """
        points, is_now = (
            transform_points(laser_from_odom, thing.points) for thing in (self.things[0], self.things[-1])
        )
        distances = np.hypot(*points.T)
        turned = (np.arctan2(points[:, 1], points[:, 0]) - scan.angle_min) * np.sign(scan.angle_increment)
        beams = np.rint(turned % math.tau / abs(scan.angle_increment)).astype(int)
        ranges = np.where(scan.is_hit, scan.ranges, scan.reach)
        beside = ranges[(beams[:, None] + [-1, 0, 1]).clip(0, len(ranges) - 1)]  # along a wall they differ by much
        is_through = distances < beside.min(axis=1) - _THERE
        is_before = distances > beside.max(axis=1) + _THERE
        ends = points * (beside[:, 1] / np.maximum(distances, 1e-6))[:, None]
        gaps = np.hypot(ends[:, None, 0] - is_now[None, :, 0], ends[:, None, 1] - is_now[None, :, 1]).min(axis=1)
        has_left = (is_through | (is_before & (gaps < _SAME))) & (beams < len(ranges))
        if has_left.mean() >= 1.0 - _STAYS:
            self.moved_at = now

    def velocity(self) -> tuple[float, float]:
        if len(self.places) < 2:
            return 0.0, 0.0
        t, x, y = np.array(self.places).T
        t = t - t.mean()
        spread = float(t @ t)
        if spread <= 0.0:
            return 0.0, 0.0
        return float(t @ x) / spread, float(t @ y) / spread

    def expected(self, now: float) -> tuple[float, float]:
        """Position on the line through the last positions."""
        t, x, y = np.array(self.places).T
        vx, vy = self.velocity()
        gone = now - float(t.mean())
        return float(x.mean()) + vx * gone, float(y.mean()) + vy * gone


class MoverWatch:
    """Tracks moving objects. Times [s] are those of the scans.

    Args:
        params: sizes and times.
    """

    def __init__(self, params: MoverParams | None = None) -> None:
        self._params = params or MoverParams()
        self._side = 2 * math.ceil(self._params.reach / _CELL) + 4
        self._tracks: list[_Track] = []
        self._slipped_at = _NEVER
        self._forget()

    def _forget(self) -> None:
        shape = (self._side, self._side)
        self._owner = np.full(
            shape, np.iinfo(np.int64).min, np.int64
        )  # the cell of the plane that an array cell represents
        self._free_at = np.full(shape, _NEVER)
        self._hit_first = np.full(shape, _NEVER)  # time of the first of the uninterrupted hits
        self._hit_last = np.full(shape, _NEVER)
        self._tracks.clear()
        self._now = _NEVER

    def see(self, scan: LaserScan, odom_from_laser: Pose2D) -> list[Mover]:
        """Add a level scan; returns the moving objects, as `movers` does later."""
        now = scan.stamp
        if now < self._now - 1.0:
            self._forget()
        if now < self._now + _PERIOD:
            return self.movers(now)
        self._now = now
        near = scan.is_hit & (scan.ranges < self._params.reach)
        angles = scan.angles
        units = np.column_stack((np.cos(angles), np.sin(angles)))
        hits = transform_points(odom_from_laser, units[near] * scan.ranges[near, None])
        is_new = self._are_new(hits, now) & ~_is_veil(scan)[near]
        if len(hits) and is_new.mean() > _SLIPPED:
            self._forget()
            self._now, self._slipped_at, is_new = now, now, np.zeros(len(hits), bool)
        moving = hits[is_new]
        self._mark_hits(hits, now)
        self._mark_free(scan, units, odom_from_laser, now)
        self._follow(_things(moving, self._params.gap, self._params.min_points), scan, odom_from_laser)
        return self.movers(now)

    def movers(self, now: float) -> list[Mover]:
        """Moving objects, extrapolated to a time close to the last scan."""
        found: list[Mover] = []
        if 0.0 <= now - self._slipped_at < self._params.memory:
            return found
        for track in self._tracks:
            if len(track.places) < _SIGHTINGS or track.moved_at < self._now - self._params.still_after:
                continue
            x, y = track.expected(now)
            found.append(Mover(x, y, *track.velocity(), now - track.since))
        return found

    @property
    def stamp(self) -> float:
        """Time of the last scan used."""
        return self._now

    # Cells: the plane, folded onto an array of `_side` cells ---------------------------------------------------------

    def _cells(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Row, column and plane cell of points."""
        ij = np.floor(points / _CELL).astype(np.int64)
        rows, columns = ij[:, 1] % self._side, ij[:, 0] % self._side
        return rows, columns, ij[:, 1] * (1 << 32) + ij[:, 0]

    def _own(self, rows: NDArray[np.int64], columns: NDArray[np.int64], number: NDArray[np.int64]) -> None:
        """Assign array cells to these places; cells that represented other places forget them."""
        stale = self._owner[rows, columns] != number
        rows, columns = rows[stale], columns[stale]
        self._owner[rows, columns] = number[stale]
        for table in (self._free_at, self._hit_first, self._hit_last):
            table[rows, columns] = _NEVER

    def _are_new(self, hits: Array, now: float) -> NDArray[np.bool_]:
        """Whether each hit lies where it was free a moment ago, with nothing long-standing beside it, shape (N,)."""
        free = np.zeros(len(hits), np.int64)
        stands = np.zeros(len(hits), bool)
        for dx, dy in _AROUND:
            r, c, n = self._cells(hits + np.array([dx, dy]) * _CELL)
            is_known = self._owner[r, c] == n
            free += is_known & (self._free_at[r, c] > now - self._params.memory)
            lasts = is_known & (self._hit_last[r, c] > now - 0.5)
            stands |= lasts & (self._hit_first[r, c] < now - self._params.still_after)
        return (free >= _MOSTLY) & ~stands

    def _mark_hits(self, hits: Array, now: float) -> None:
        if not len(hits):
            return
        rows, columns, number = self._cells(hits)
        self._own(rows, columns, number)
        paused = self._hit_last[rows, columns] < now - 0.5
        self._hit_first[rows[paused], columns[paused]] = now
        self._hit_last[rows, columns] = now

    def _mark_free(self, scan: LaserScan, units: Array, odom_from_laser: Pose2D, now: float) -> None:
        ranges = np.where(np.isposinf(scan.ranges), scan.reach, scan.ranges)
        valid = (ranges >= scan.range_min) & ~np.isnan(ranges)
        lengths = np.minimum(ranges[valid] - _MARGIN, self._params.reach)
        units = units[valid]
        thin = max(1, len(units) // 360)
        lengths, units = lengths[::thin], units[::thin]
        steps = np.arange(scan.range_min, self._params.reach, _CELL)
        if not len(lengths) or not len(steps):
            return
        along = (units[:, None, :] * steps[None, :, None])[steps[None, :] < lengths[:, None]]
        rows, columns, number = self._cells(transform_points(odom_from_laser, along))
        self._own(rows, columns, number)
        self._free_at[rows, columns] = now

    # Things ----------------------------------------------------------------------------------------------------------

    def _follow(self, things: list[_Thing], scan: LaserScan, odom_from_laser: Pose2D) -> None:
        p, now, laser_from_odom = self._params, scan.stamp, invert(odom_from_laser)
        expected = [track.expected(now) for track in self._tracks]
        pairs = sorted(
            (math.dist(place, thing.middle), i, k)
            for i, place in enumerate(expected)
            for k, thing in enumerate(things)
            if math.dist(place, thing.middle) < p.jump
        )
        taken_tracks: set[int] = set()
        taken_things: set[int] = set()
        for _, i, k in pairs:
            if i in taken_tracks or k in taken_things:
                continue
            taken_tracks.add(i)
            taken_things.add(k)
            self._tracks[i].add(now, things[k], p.window)
            self._tracks[i].look_back(scan, laser_from_odom, now)
        for k, thing in enumerate(things):
            if k not in taken_things:
                self._tracks.append(_Track(since=now))
                self._tracks[-1].add(now, thing, p.window)
        self._tracks = [track for track in self._tracks if track.places[-1][0] >= now - p.coast]


def _is_veil(scan: LaserScan) -> NDArray[np.bool_]:
    """Which beams end in the air behind an edge, or graze a wall, shape (N,).

    Such points wander with the robot; laser_filters' ScanShadowsFilter removes them by the same criterion.
    """
    ranges = np.where(scan.is_hit, scan.ranges, scan.reach)
    steps = np.diff(ranges, prepend=ranges[:1], append=ranges[-1:])
    before, after = steps[:-1], steps[1:]
    return ((before > _VEIL) & (after > _VEIL)) | ((before < -_VEIL) & (after < -_VEIL))


def _things(points: Array, gap: float, least: int) -> list[_Thing]:
    """Groups of points closer to each other than a gap."""
    found = []
    left = list(range(len(points)))
    while left:
        group, queue = [], [left.pop()]
        while queue:
            i = queue.pop()
            group.append(i)
            close = [k for k in left if math.dist(points[i], points[k]) < gap]
            left = [k for k in left if k not in close]
            queue += close
        if len(group) >= least:
            found.append(_Thing(points[group]))
    return found
