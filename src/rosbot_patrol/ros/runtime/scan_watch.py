"""Watch of amcl and slam_gmapping over the lidar (silent or invalid scans) and the clock (jumps back)."""

from __future__ import annotations

import logging

import rospy

from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan_check import ScanCheck

log = logging.getLogger(__name__)

PATIENCE_S = 1.0  # single bad scans among good ones are only logged
SILENT_S = 15.0  # silence of the lidar that raises a warning, as in upstream's amcl


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
