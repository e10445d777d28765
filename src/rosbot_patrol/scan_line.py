"""Scans that wait until it is known where the robot was when they were taken, and leave in their order.

amcl, slam_gmapping and their replay offline decide by it which scan is taken in when.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.scan import LaserScan

GIVE_UP_S, GIVE_UP_WAITING_S = 1.0, 2.0  # a scan this much older than the newest, or waiting for so long, is dropped
FARTHEST_M = 1e6  # from where the odometry began: what says more is a bit fault on the way from the wheels


@dataclass(frozen=True)
class PlacedScan:
    """A level scan, the robot in the odometry's frame at its time, and the pose of the scan's laser on the robot."""

    scan: LaserScan
    odom_from_base: Pose2D
    base_from_laser: Pose2D


@dataclass(frozen=True, eq=False)
class _Entry:
    """A scan that waits and when it came [s]; known by itself, not by what it holds."""

    scan: LaserScan
    arrival: float


class ScanLine:
    """Hands out scans in their order, each once it can be placed; one that cannot holds up no other.

    One thread may add while another takes.

    Args:
        place: places a scan; raises TransformError or ValueError where that cannot be, or not yet.
        size: most scans that wait; the oldest goes first.
    """

    def __init__(self, place: Callable[[LaserScan], PlacedScan], size: int = 100) -> None:
        self._place = place
        self._waiting: deque[_Entry] = deque(maxlen=size)
        self._newest = -math.inf
        self.problem = ""  # why the last scan that was dropped could not be placed
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, scan: LaserScan, now: float) -> None:
        """Add a scan that came at a time [s] of any clock that never goes back."""
        if scan.stamp < self._newest - GIVE_UP_S:  # the clock was set back: what waits is of another time
            self._waiting.clear()
        self._newest = scan.stamp
        self._waiting.append(_Entry(scan, now))

    def take(self, now: float) -> PlacedScan | None:
        """The oldest scan that can be placed, None where none can be; the time [s] is of the clock of `put`."""
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
        """Take it out; False where a full queue, a clock set back or an earlier try was faster."""
        try:
            if self._waiting[0] is entry:
                self._waiting.popleft()
            else:
                self._waiting.remove(entry)
        except (ValueError, IndexError):
            return False
        return True
