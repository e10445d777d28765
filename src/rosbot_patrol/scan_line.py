"""Queue of scans that wait for the robot's pose at their stamp, and leave in order.

It decides for amcl, slam_gmapping and their replay which scan is used, and when.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.scan import LaserScan

GIVE_UP_S, GIVE_UP_WAITING_S = (
    1.0,
    2.0,
)  # a scan this much older than the newest, or waiting longer than the second, is dropped
FARTHEST_M = 1e6  # from the odometry's origin: a larger distance is a bit error


@dataclass(frozen=True)
class PlacedScan:
    """A level scan, the robot's pose in the odometry frame at its stamp, and the pose of its laser on the robot."""

    scan: LaserScan
    odom_from_base: Pose2D
    base_from_laser: Pose2D


@dataclass(frozen=True, eq=False)
class _Entry:
    """A waiting scan and the time of its arrival [s]; compared by identity."""

    scan: LaserScan
    arrival: float


class ScanLine:
    """Hands out scans in order, each when it can be placed; an unplaceable scan does not hold up others.

    One thread may add while another takes.

    Args:
        place: function that places a scan; raises TransformError or ValueError if that is impossible now.
        size: maximum number of waiting scans; the oldest is dropped first.
    """

    def __init__(self, place: Callable[[LaserScan], PlacedScan], size: int = 100) -> None:
        self._place = place
        self._waiting: deque[_Entry] = deque(maxlen=size)
        self._newest = -math.inf
        self.problem = ""  # reason why the last dropped scan could not be placed
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, scan: LaserScan, now: float) -> None:
        """Add a scan that arrived at a time [s] of a clock that never goes back."""
        if scan.stamp < self._newest - GIVE_UP_S:  # the clock was set back: waiting scans have stamps of another time
            self._waiting.clear()
        self._newest = scan.stamp
        self._waiting.append(_Entry(scan, now))

    def take(self, now: float) -> PlacedScan | None:
        """Take the oldest scan that can be placed, None if there is none; the time [s] is of the clock of `put`."""
        entries = list(self._waiting)
        for i, entry in enumerate(entries):
            placed = self._try(entry, now)
            if placed is None:
                continue
            # tf may have come since the older ones were tried, and they go first: a scan that is late is lost
            for older in entries[:i]:
                earlier = self._try(older, now)
                if earlier is not None:
                    entry, placed = older, earlier
                    break
            self._forget(entry)
            self.problem = ""
            return placed
        return None

    def _try(self, entry: _Entry, now: float) -> PlacedScan | None:
        try:
            placed = self._place(entry.scan)
            x, y, _ = placed.odom_from_base
            if not math.hypot(x, y) <= FARTHEST_M:
                raise ValueError(f"the odometry says ({x:.3g}, {y:.3g}) m, which is no place")
            return placed
        except (TransformError, ValueError) as err:
            self._drop_when_old(entry, now, str(err))
            return None

    def _drop_when_old(self, entry: _Entry, now: float, why: str) -> None:
        is_old = self._newest - entry.scan.stamp > GIVE_UP_S or now - entry.arrival > GIVE_UP_WAITING_S
        if is_old and self._forget(entry):
            self.problem = why
            self.dropped += 1

    def _forget(self, entry: _Entry) -> bool:
        """Remove an entry; False if it has already gone."""
        try:
            if self._waiting[0] is entry:
                self._waiting.popleft()
            else:
                self._waiting.remove(entry)
        except (ValueError, IndexError):
            return False
        return True
