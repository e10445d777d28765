"""What amcl and slam_gmapping watch alike: whether the lidar speaks and makes sense, whether the clock went back."""

from __future__ import annotations

import logging

import rospy

from rosbot_patrol.counts import count_of
from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_check import ScanCheck

log = logging.getLogger(__name__)

PATIENCE_S = 1.0  # single bad scans among good ones are only logged
SILENT_S = 15.0  # as upstream's amcl: a lidar that says nothing for so long is warned of


class ScanWatch:
    """Watches the topic `scan` of a node that lives on it.

    Args:
        transforms: forgotten when time goes back.
        lost: what does not happen while no scan comes, such as "nothing is mapped".
    """

    def __init__(self, transforms: Transforms, lost: str) -> None:
        self._transforms, self._lost = transforms, lost
        self._check = ScanCheck(lost)
        self._last_scan = self._last_time = now()
        self._beams: dict[str, int] = {}  # of the last scan of each frame

    def hear(self) -> None:
        """A scan came."""
        self._last_scan = now()

    def is_usable(self, scan: LaserScan) -> bool:
        """Whether a scan can be used; a warning says why not, and where the number of its beams has changed."""
        current = now()
        if not self._check.accepts(scan, current):
            return False
        self._check.clear(current)
        name, beams = f"scan of frame '{scan.frame_id}'", len(scan.ranges)
        before, self._beams[scan.frame_id] = self._beams.get(scan.frame_id, beams), beams
        if beams != before:
            many = count_of(beams, "beam")
            rospy.logwarn_throttle(10.0, f"{name}: it has {many}, {before} before; it is taken as it is")
        return True

    def tend(self, current: float) -> str:
        """Look at the clock and the lidar; to be called each second or so.

        Args:
            current: time now [s].

        Returns:
            What is wrong with the lidar, empty where it speaks and makes sense.
        """
        if current < self._last_time - 1.0:
            log.warning("time went back by %.1f s: old transforms are forgotten", self._last_time - current)
            self._transforms.buffer.clear()
        if abs(current - self._last_time) > SILENT_S:  # the clock was set, nobody was silent for so long
            self._last_scan = current
        self._last_time = current
        silent = current - self._last_scan
        if silent <= SILENT_S:
            return f"{self._check.problem}; {self._lost}" if self._check.lasts(current, PATIENCE_S) else ""
        text = f"no laser scan received on {rospy.resolve_name('scan')} for {silent:.0f} seconds: {self._lost}"
        rospy.logwarn_throttle(SILENT_S, text[0].upper() + text[1:])
        return text
