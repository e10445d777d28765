"""Scans that wait until it is known where the robot was when they were taken, and leave in their order.

amcl, slam_gmapping and their replay offline decide by it which scan is taken in when.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.scan import LaserScan, Mount

GIVE_UP_S, GIVE_UP_WAITING_S = 1.0, 2.0  # a scan this much older than the newest, or waiting for so long, is dropped


@dataclass(frozen=True)
class PlacedScan:
    """A scan, the robot in the odometry's frame at its time, and how the laser sits on the robot."""

    scan: LaserScan
    odom_from_base: Pose2D
    mount: Mount


class ScanLine:
    """Hands out scans in their order, each once it can be placed; one that cannot holds up no other.

    One thread may add while another takes.

    Args:
        place: places a scan; raises TransformError or ValueError where that cannot be, or not yet.
        size: most scans that wait; the oldest goes first.
    """

    def __init__(self, place: Callable[[LaserScan], PlacedScan], size: int = 100) -> None:
        self._place = place
        self._waiting: deque[tuple[LaserScan, float]] = deque(maxlen=size)
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
        self._waiting.append((scan, now))

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

    def _try(self, entry: tuple[LaserScan, float], now: float) -> PlacedScan | None:
        try:
            return self._place(entry[0])
        except (TransformError, ValueError) as err:
            self._drop_when_old(entry, now, str(err))
            return None

    def _drop_when_old(self, entry: tuple[LaserScan, float], now: float, why: str) -> None:
        scan, arrival = entry
        if self._newest - scan.stamp > GIVE_UP_S or now - arrival > GIVE_UP_WAITING_S:
            self._forget(entry)
            self.problem = why
            self.dropped += 1

    def _forget(self, entry: tuple[LaserScan, float]) -> None:
        with contextlib.suppress(ValueError, IndexError):  # a full queue or a clock set back was faster
            if self._waiting[0] is entry:
                self._waiting.popleft()
            else:
                self._waiting.remove(entry)
