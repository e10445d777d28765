"""Scans that wait until tf knows where the robot was when they were taken (tf's MessageFilter, without its locks)."""

from __future__ import annotations

import threading
import time

from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_line import PlacedScan as PlacedScan
from rosbot_patrol.scan_line import ScanLine

POLL_S, IDLE_S = 0.008, 0.2


class ScanQueue:
    """A ScanLine that is fed by tf and waited at.

    Args:
        transforms: the node's tf.
        odom: frame of the odometry.
        base: frame of the robot.
        size: most scans that wait; the oldest goes first.
    """

    def __init__(self, transforms: Transforms, odom: str, base: str, size: int = 100) -> None:
        self._transforms = transforms
        self._odom, self._base = odom, base
        self._arrived = threading.Event()
        self._line = ScanLine(self._place, size)

    @property
    def problem(self) -> str:
        """Why the last scan that was dropped could not be placed, "" where the newest could."""
        return self._line.problem

    @property
    def dropped(self) -> int:
        """Scans that could never be placed."""
        return self._line.dropped

    def put(self, scan: LaserScan) -> None:
        """Add a scan; called by the subscriber."""
        self._line.put(scan, time.monotonic())
        self._arrived.set()

    def take(self) -> PlacedScan | None:
        """The oldest scan that can be placed, None where none can be now; waits for a few milliseconds at most."""
        if not self._line:
            self._arrived.wait(IDLE_S)
        self._arrived.clear()
        found = self._line.take(time.monotonic())
        if found is None and self._line:
            time.sleep(POLL_S)
        return found

    def _place(self, scan: LaserScan) -> PlacedScan:
        level = level_scan(scan, self._transforms.transform(self._base, scan.frame_id), self._base)
        return PlacedScan(level.scan, self._transforms.lookup(self._odom, self._base, scan.stamp), level.pose)
