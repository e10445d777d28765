"""The newest scan: judged once, placed in the map, and how near the nearest thing is."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.patrol.records.inputs import ScanView
from rosbot_patrol.patrol.senses.health import OK, WARN, Health
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.tf.frames import Frames

_PLACED_FOR = 0.5  # longest time for which the last placed scan stands in for one whose place is not known yet [s]


class Lidar:
    """Keeps the newest scan.

    Args:
        params: names of frames, and the scan's maximum age.
        transforms: of the robot.
        health: told whether scans can be used.

    Attributes:
        view: the newest scan that could be placed, level, with its pose in map; None before the first.
    """

    def __init__(self, params: InputParams, transforms: Frames, health: Health) -> None:
        self._params, self._transforms, self._health = params, transforms, health
        self._check = ScanCheck("the patrol looks as without a lidar")
        self._newest: tuple[LaserScan, float] | None = None
        self._checked: tuple[LaserScan, bool] | None = None
        self._placed: LaserScan | None = None  # the scan of `view`, as it was heard
        self._nearest: tuple[LaserScan, float | None] | None = None
        self.view: ScanView | None = None

    def hear(self, scan: LaserScan, now: float) -> None:
        """Take a scan that came at a time [s]."""
        self._newest = scan, now

    def usable(self, now: float) -> LaserScan | None:
        """Give the newest scan; None if it is too old at a time [s] or says nothing."""
        if self._newest is None or abs(now - self._newest[1]) > self._params.scan_timeout:
            return None
        scan = self._newest[0]
        if self._checked is None or self._checked[0] is not scan:
            self._checked = scan, self._check.accepts(scan, now)
            if self._check.problem:
                self._tell()
        return scan if self._checked[1] else None

    def place(self, scan: LaserScan | None, now: float) -> ScanView | None:
        """Lay a scan level and place it in map; None if there is none or its place is not known."""
        if scan is None:
            return None
        if self._placed is scan:
            return self.view
        frame = self._params.map_frame
        try:
            level = level_scan(scan, self._transforms.transform(frame, scan.frame_id, scan.stamp), frame)
        except LaserTilted as err:
            self._refuse(err, now)
            return None
        except TransformError:
            return self.view if self._placed and abs(scan.stamp - self._placed.stamp) < _PLACED_FOR else None
        self._check.clear(now)
        self._tell()
        self._placed, self.view = scan, ScanView(scan=level.scan, map_from_laser=level.pose)
        return self.view

    def clearance(self, scan: LaserScan | None, now: float) -> float | None:
        """Give the distance from the robot's centre to the nearest thing [m], None if not known."""
        if scan is None:
            return None
        if self._nearest is None or self._nearest[0] is not scan:
            base = self._params.base_frame
            try:
                points = level_scan(scan, self._transforms.transform(base, scan.frame_id), base).points
            except LaserTilted as err:
                self._refuse(err, now)
                return None
            except TransformError:
                return None
            self._nearest = scan, float(np.hypot(*points.T).min()) if len(points) else None
        return self._nearest[1]

    def rest(self) -> None:
        """Note that nobody looks at scans now: what was wrong with them may be mended."""
        if self._check.problem:
            self._check.problem = ""
            self._health.drop("lidar")

    def _refuse(self, err: LaserTilted, now: float) -> None:
        self._check.refuse(str(err), now)
        self._tell()

    def _tell(self) -> None:
        problem = self._check.problem
        self._health.set("lidar", WARN if problem else OK, problem or "scans can be used")
