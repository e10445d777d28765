"""Motion that the lidar sees and the map does not explain.

It needs no light and no camera, so a patrol whose camera failed can still tell that something moved. Points on floor
that the map leaves free are grouped, and each group is followed from scan to scan as a track. A track has moved if it
is some way from its first place and the lidar now looks through that place. A chair that was pushed aside is off the
map, too, but stays. If many points are off the map the robot does not know where it is, and nothing is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.params import param
from rosbot_patrol.patrol.house.floor import Array, Floor
from rosbot_patrol.scan import LaserScan, scan_points


@dataclass(frozen=True, kw_only=True)
class LidarMotionParams:
    """Conditions under which a lidar track counts as moving."""

    witness_reach: float = param(6.0, unit="m", lo=0.5, doc="maximum range of lidar points that are tracked")
    off_map: float = param(
        0.3, unit="m", lo=0.05, doc="minimum distance of a lidar point from everything on the map to be tracked"
    )
    lost_share: float = param(
        0.4, lo=0.05, hi=1.0, doc="share of points off the map above which the pose is distrusted and the scan ignored"
    )
    moved: float = param(
        0.3, unit="m", lo=0.05, doc="distance from where it was first seen at which an object counts as moved"
    )
    moved_drift: float = param(0.05, lo=0.0, doc="added to `moved` per metre of distance, for the heading error")
    thing_gap: float = param(
        0.4, unit="m", lo=0.05, doc="points closer than this belong to one object: two legs, one person"
    )
    thing_size: float = param(
        1.2, unit="m", lo=0.1, doc="larger groups of points are furniture or the wall of another room"
    )
    thing_points: int = param(3, lo=1, doc="minimum number of lidar points on an object")
    thing_jump: float = param(0.6, unit="m", lo=0.1, doc="maximum movement of an object between two scans")
    thing_memory: float = param(1.5, unit="s", lo=0.1, doc="time without a sighting after which an object is forgotten")
    witness_period: float = param(0.2, unit="s", lo=0.0, doc="minimum time between the scans used")


@dataclass(frozen=True, kw_only=True)
class Moved:
    """Something that moved: where it was last in map [m], when [s], and how far from its first place [m]."""

    x: float
    y: float
    at: float
    far: float


@dataclass
class LidarTrack:
    """Something that is followed.

    Attributes:
        first: its points in map when it was first seen [m], shape (N, 2); start: their middle; since: when [s].
        x, y: where it is in map [m]; at: when it was seen last [s]; looks: how often.
        has_moved: it is some way from where it was first seen, and the lidar looks through that place.
    """

    first: Array
    start: tuple[float, float]
    since: float
    x: float
    y: float
    at: float
    looks: int = 1
    has_moved: bool = False


class LidarMotion:
    """Follows what is not on the map.

    Args:
        params: what counts.

    Attributes:
        tracks: that it follows; moved: what moved farthest.
    """

    def __init__(self, params: LidarMotionParams | None = None) -> None:
        self.params = params or LidarMotionParams()
        self.tracks: list[LidarTrack] = []
        self._last = -math.inf
        self.moved: Moved | None = None

    def start(self) -> None:
        """Forget everything."""
        self.tracks.clear()
        self._last, self.moved = -math.inf, None

    def see(self, scan: LaserScan, map_from_laser: Pose2D, floor: Floor) -> None:
        """Take a scan; `moved` holds what moved farthest since `start`."""
        p, now = self.params, scan.stamp
        if now < self._last + p.witness_period:
            return
        self._last = now
        points = scan_points(scan)
        points = points[np.hypot(*points.T) < p.witness_reach] if len(points) else points
        off = off_the_map(floor, transform_points(map_from_laser, points), p.off_map)
        if len(off) > p.lost_share * max(len(points), 1):
            self.tracks.clear()
            return
        self._follow(now, groups(off, p.thing_gap, p.thing_points), scan, map_from_laser)

    def text(self) -> str:
        """What moved, in words, "" where nothing did."""
        m = self.moved
        return f"something moved by {m.far:.1f} m at ({m.x:.1f}, {m.y:.1f})" if m else ""

    def _follow(self, now: float, found: list[Array], scan: LaserScan, map_from_laser: Pose2D) -> None:
        p = self.params
        places = [(points.min(axis=0) + points.max(axis=0)) / 2.0 for points in found]
        small = [k for k, points in enumerate(found) if np.ptp(points, axis=0).max() <= p.thing_size]
        pairs = sorted(
            (math.dist((track.x, track.y), places[k]), i, k) for i, track in enumerate(self.tracks) for k in small
        )
        matched: set[int] = set()
        taken: set[int] = set()
        for apart, i, k in pairs:
            if apart > p.thing_jump or i in matched or k in taken:
                continue
            matched.add(i)
            taken.add(k)
            self._see_again(self.tracks[i], now, places[k], scan, map_from_laser)
        for k in small:
            if k not in taken:
                x, y = float(places[k][0]), float(places[k][1])
                self.tracks.append(LidarTrack(first=found[k], start=(x, y), since=now, x=x, y=y, at=now))
        self.tracks = [track for track in self.tracks if now - track.at <= p.thing_memory]

    def _see_again(self, track: LidarTrack, now: float, place: Array, scan: LaserScan, map_from_laser: Pose2D) -> None:
        track.x, track.y, track.at = float(place[0]), float(place[1]), now
        track.looks += 1
        far = math.dist(track.start, (track.x, track.y))
        away = math.dist(track.start, (map_from_laser.x, map_from_laser.y))
        if track.looks < 3 or far < self.params.moved + self.params.moved_drift * away:
            return
        is_farthest = self.moved is None or far > self.moved.far
        if track.has_moved and not is_farthest:
            return
        if not _is_looked_through(track.first, scan, map_from_laser):
            return
        track.has_moved = True
        if is_farthest:
            self.moved = Moved(x=track.x, y=track.y, at=now, far=far)


def off_the_map(floor: Floor, points: Array, tolerance: float) -> Array:
    """Those of some points that lie on the map's floor, farther than a tolerance [m] from all that stands there.

    Args:
        floor: of the map.
        points: in map [m], shape (N, 2).
        tolerance: [m], at most the 1 m to which clearances are known.
    """
    if not len(points):
        return points
    ix, iy, inside = floor.indices(points[:, 0], points[:, 1])
    return points[inside & (floor.clearance[iy, ix] >= tolerance)]


def groups(points: Array, gap: float, least: int) -> list[Array]:
    """Groups of at least so many points that are nearer to each other than a gap [m]."""
    if not len(points):
        return []
    near = np.hypot(points[:, None, 0] - points[None, :, 0], points[:, None, 1] - points[None, :, 1]) < gap
    label = np.arange(len(points))
    while True:
        lowest = np.where(near, label[None, :], len(points)).min(axis=1)
        if (lowest == label).all():
            break
        label = lowest
    return [points[label == each] for each in np.unique(label) if (label == each).sum() >= least]


def _is_looked_through(points: Array, scan: LaserScan, map_from_laser: Pose2D) -> bool:
    """Whether most of some places in map lie before the ends of a scan's beams: nothing stands there any more."""
    dx, dy = points[:, 0] - map_from_laser.x, points[:, 1] - map_from_laser.y
    away = np.hypot(dx, dy)
    turn = (np.arctan2(dy, dx) - map_from_laser.yaw - scan.angle_min) * math.copysign(1.0, scan.angle_increment)
    beams = np.rint(turn % math.tau / abs(scan.angle_increment)).astype(np.int64)
    whole = round(math.tau / abs(scan.angle_increment))
    beams = np.where(beams >= whole, beams - whole, beams)
    known = beams < len(scan.ranges)
    ranges = np.where(scan.is_hit, scan.ranges, scan.reach)[np.where(known, beams, 0)]
    return bool((known & (ranges > away + 0.2)).mean() >= 0.7)
