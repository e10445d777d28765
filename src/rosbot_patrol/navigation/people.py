"""Who moves around the robot: scans in, and for whom a command has to wait."""

from __future__ import annotations

from rosbot_patrol.control.give_way import GiveWay, GiveWayParams
from rosbot_patrol.control.movers import Mover, MoverParams, MoverWatch
from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.scan import LaserScan, level_scan
from rosbot_patrol.scan_check import ScanCheck
from rosbot_patrol.tf.frames import Frames

_LATEST = 1.0  # a scan older than that tells of nobody [s]


class People:
    """Follows who moves by the scans of one topic. `hear` may come from another thread than all else.

    Args:
        frames: transforms.
        frame: of the odometry, in which the robot's way between two scans is known.
        movers: parameters of the watch.
        give_way: parameters of the decision.
    """

    def __init__(self, frames: Frames, frame: str, movers: MoverParams, give_way: GiveWayParams) -> None:
        self._frames, self._frame = frames, frame
        self._watch = MoverWatch(movers)
        self._give_way = GiveWay(give_way)
        self._unseen: LaserScan | None = None  # the newest scan that the watch has not seen
        self._check = ScanCheck("nobody is waited for")

    def hear(self, scan: LaserScan) -> None:
        """Keep a scan until the next look."""
        self._unseen = scan

    def look(self, now: float) -> None:
        """Show the newest scan to the watch, once its place is known; `now` [s] is for what is logged."""
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
            return  # not yet: the next look tries again
        self._forget(scan)
        self._check.clear(now)
        self._watch.see(level.scan, level.pose)

    def waits(self, wish: Twist2D, odom_from_base: Pose2D, now: float) -> str:
        """For whom the robot has to wait instead of driving a velocity, "" for nobody."""
        return self._give_way.waits(wish, self.movers(now), odom_from_base, now)

    def movers(self, now: float) -> list[Mover]:
        """Who moves."""
        return self._watch.movers(now) if abs(now - self._watch.stamp) <= _LATEST else []

    def _forget(self, scan: LaserScan) -> None:
        if self._unseen is scan:
            self._unseen = None
