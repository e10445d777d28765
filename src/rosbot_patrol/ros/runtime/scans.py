"""Scans of amcl and slam_gmapping: a queue that waits for tf, and a watch over the lidar and the clock."""

from __future__ import annotations

import logging
import threading
import time

import rospy

from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.scan_feed import ScanFeed
from rosbot_patrol.scan_line import PlacedScan

log = logging.getLogger(__name__)

POLL_S, IDLE_S = 0.008, 0.2
PATIENCE_S = 1.0  # single bad scans among good ones are only logged
SILENT_S = 15.0  # silence of the lidar that raises a warning, as in upstream's amcl


class ScanQueue:
    """A ScanFeed that a subscriber fills and a worker reads: tf's MessageFilter, without its locks.

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


class ScanWatch:
    """Watch over the topic `scan`.

    Args:
        transforms: cleared when time goes back.
        check: checks the scans.
    """

    def __init__(self, transforms: Transforms, check: ScanCheck) -> None:
        self._transforms, self._check = transforms, check
        self._last_scan = self._last_time = now()

    def hear(self) -> None:
        """Record that a scan came."""
        self._last_scan = now()

    def tend(self, current: float) -> str:
        """Check the clock and the lidar; call about once a second.

        Args:
            current: time now [s].

        Returns:
            What is wrong with the lidar, "" if it sends valid scans.
        """
        if current < self._last_time - 1.0:
            log.warning("time went back by %.1f s: old transforms are forgotten", self._last_time - current)
            self._transforms.buffer.clear()
        if abs(current - self._last_time) > SILENT_S:  # the clock was set; that is no silence of the lidar
            self._last_scan = current
        self._last_time = current
        silent = current - self._last_scan
        if silent <= SILENT_S:
            check = self._check
            return f"{check.problem}; {check.lost}" if check.lasts(current, PATIENCE_S) else ""
        text = f"no laser scan received on {rospy.resolve_name('scan')} for {silent:.0f} seconds: {self._check.lost}"
        rospy.logwarn_throttle(SILENT_S, text[0].upper() + text[1:])
        return text
