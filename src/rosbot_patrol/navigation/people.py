"""People who move around the robot: scans in, and whether a command has to wait for them."""

from __future__ import annotations

from rosbot_patrol.control.give_way import GiveWay, GiveWayParams
from rosbot_patrol.control.movers import Mover, MoverParams, MoverWatch
from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.tf.frames import Frames

_LATEST = 1.0  # maximum age of a scan [s]


class People:
    """Tracks moving people by the scans of one topic. `hear` may be called from another thread than the rest.

    Args:
        frames: transforms.
        frame: of the odometry, for the robot's motion between two scans.
        movers: parameters of the tracking.
        give_way: parameters of giving way.
    """

    def __init__(self, frames: Frames, frame: str, movers: MoverParams, give_way: GiveWayParams) -> None:
        self._frames, self._frame = frames, frame
        self._watch = MoverWatch(movers)
        self._give_way = GiveWay(give_way)
        self._unseen: LaserScan | None = None  # the newest scan not yet tracked
        self._check = ScanCheck("nobody is waited for")

    def hear(self, scan: LaserScan) -> None:
        """Keep a scan until the next look."""
        self._unseen = scan

    def look(self, now: float) -> None:
        """Track the newest scan once its place is known; `now` [s] is for the log."""
        scan = self._unseen
        if scan is None:
            return
        if not self._check.accepts(scan, now):
            self._forget(scan)
            return
        try:
            level = level_scan(scan, self._frames.transform(self._frame, scan.frame_id, scan.stamp), self._frame)
        except LaserTilted as err:
            self._check.refuse(str(err), now)
            self._forget(scan)
            return
        except TransformError:
            return  # not yet: the next call tries again
        self._forget(scan)
        self._check.clear(now)
        self._watch.see(level.scan, level.pose)

    def waits(self, wish: Twist2D, odom_from_base: Pose2D, now: float) -> str:
        """Description of the person to wait for instead of driving a velocity, "" for nobody."""
        return self._give_way.waits(wish, self.movers(now), odom_from_base, now)

    def movers(self, now: float) -> list[Mover]:
        """The moving people."""
        return self._watch.movers(now) if abs(now - self._watch.stamp) <= _LATEST else []

    def _forget(self, scan: LaserScan) -> None:
        if self._unseen is scan:
            self._unseen = None
