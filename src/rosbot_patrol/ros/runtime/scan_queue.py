"""Queue of scans with its own waiting for scans and tf (tf's MessageFilter, without its locks)."""

from __future__ import annotations

import threading
import time

from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_feed import ScanFeed
from rosbot_patrol.scan_line import PlacedScan

POLL_S, IDLE_S = 0.008, 0.2


class ScanQueue:
    """A ScanFeed that a subscriber fills and a worker reads.

    Args:
        feed: checks and places the scans.
    """

    def __init__(self, feed: ScanFeed) -> None:
        self._feed = feed
        self._arrived = threading.Event()

    def put(self, scan: LaserScan) -> None:
        """Add a scan; the subscriber calls it."""
        if self._feed.hear(scan, now(), time.monotonic()):
            self._arrived.set()

    def take(self) -> PlacedScan | None:
        """Take the oldest scan that can be placed, None if there is none; waits a few milliseconds at most."""
        if not len(self._feed):
            self._arrived.wait(IDLE_S)
        self._arrived.clear()
        found = self._feed.take(time.monotonic())
        if found is None and len(self._feed):
            time.sleep(POLL_S)
        return found
