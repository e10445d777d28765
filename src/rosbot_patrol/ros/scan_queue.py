"""Scans that wait until tf knows where the robot was when they were taken (tf's MessageFilter, without its locks)."""

from __future__ import annotations

import threading
import time

import rospy
import tf2_ros

from rosbot_patrol.errors import TransformError
from rosbot_patrol.ros.transforms import Transforms
from rosbot_patrol.scan import LaserScan, Mount, level_mount
from rosbot_patrol.scan_line import PlacedScan as PlacedScan
from rosbot_patrol.scan_line import ScanLine

POLL_S, IDLE_S = 0.008, 0.2


def mount_of(transforms: Transforms, base: str, laser: str) -> Mount:
    """How the laser sits on the robot.

    Raises:
        TransformError: tf does not know it, or the laser does not look along the floor.
    """
    try:
        found = transforms.buffer.lookup_transform(base, laser, rospy.Time(0)).transform
        t, q = found.translation, found.rotation
        return level_mount(t.x, t.y, (q.x, q.y, q.z, q.w))
    except (tf2_ros.TransformException, ValueError) as err:
        raise TransformError(base, laser, str(err)) from err


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
        self._mounts: dict[str, Mount] = {}
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
        mount = self._mount(scan.frame_id)
        return PlacedScan(scan, self._transforms.lookup(self._odom, self._base, scan.stamp), mount)

    def _mount(self, frame: str) -> Mount:
        if frame not in self._mounts:
            self._mounts[frame] = mount_of(self._transforms, self._base, frame)
        return self._mounts[frame]
