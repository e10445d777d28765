"""Scans that wait until tf knows where the robot was when they were taken (tf's MessageFilter, without its locks)."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import deque
from dataclasses import dataclass

import rospy
import tf2_ros

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, yaw_from_quaternion
from rosbot_patrol.ros.transforms import Transforms
from rosbot_patrol.scan import LaserScan, Mount

POLL_S, IDLE_S = 0.008, 0.2
GIVE_UP_S, GIVE_UP_WALL_S = 1.0, 2.0  # a scan this much older than the newest, or waiting for so long, is dropped


@dataclass(frozen=True)
class PlacedScan:
    """A scan, the robot in the odometry's frame at its time, and how the laser sits on the robot."""

    scan: LaserScan
    odom_from_base: Pose2D
    mount: Mount


def mount_of(transforms: Transforms, base: str, laser: str) -> Mount:
    """How the laser sits on the robot.

    Raises:
        TransformError: tf does not know it, or the laser does not look along the floor.
    """
    try:
        found = transforms.buffer.lookup_transform(base, laser, rospy.Time(0)).transform
    except tf2_ros.TransformException as err:
        raise TransformError(base, laser, str(err)) from err
    t, q = found.translation, found.rotation
    upright = 1.0 - 2.0 * (q.x * q.x + q.y * q.y)  # z component of the sensor's z axis
    if abs(upright) < 0.9:
        raise TransformError(base, laser, "the laser is not mounted level, its scan is no plan of the room")
    return Mount(Pose2D(t.x, t.y, yaw_from_quaternion(q.x, q.y, q.z, q.w)), upright < 0.0)


class ScanQueue:
    """Hands out scans in their order, each once its odometry is known; one that cannot be placed holds up no other.

    Args:
        transforms: the node's tf.
        odom: frame of the odometry.
        base: frame of the robot.
        size: most scans that wait; the oldest goes first.
    """

    def __init__(self, transforms: Transforms, odom: str, base: str, size: int = 100) -> None:
        self._transforms = transforms
        self._odom, self._base = odom, base
        self._waiting: deque[tuple[LaserScan, float]] = deque(maxlen=size)
        self._arrived = threading.Event()
        self._mounts: dict[str, Mount] = {}
        self._newest = -math.inf
        self.problem = ""  # why the last scan that was dropped could not be placed
        self.dropped = 0

    def put(self, scan: LaserScan) -> None:
        """Add a scan; called by the subscriber."""
        if scan.stamp < self._newest - GIVE_UP_S:  # the clock was set back: what waits is of another time
            self._waiting.clear()
        self._newest = scan.stamp
        self._waiting.append((scan, time.monotonic()))
        self._arrived.set()

    def take(self) -> PlacedScan | None:
        """The oldest scan that can be placed, None where none can be now; waits for a few milliseconds at most."""
        if not self._waiting:
            self._arrived.wait(IDLE_S)
        self._arrived.clear()
        found = self._first_placed()
        if found is not None:
            return found
        if self._waiting:
            time.sleep(POLL_S)
        return None

    def _first_placed(self) -> PlacedScan | None:
        entries = list(self._waiting)
        for i, entry in enumerate(entries):
            placed = self._try(entry)
            if placed is None:
                continue
            # tf may have come since the older ones were tried, and they go first: a scan that is late is lost
            for older in entries[:i]:
                earlier = self._try(older)
                if earlier is not None:
                    entry, placed = older, earlier
                    break
            self._forget(entry)
            self.problem = ""
            return placed
        return None

    def _try(self, entry: tuple[LaserScan, float]) -> PlacedScan | None:
        try:
            return self._place(entry[0])
        except (TransformError, ValueError) as err:
            self._drop_when_old(entry, str(err))
            return None

    def _place(self, scan: LaserScan) -> PlacedScan:
        mount = self._mount(scan.frame_id)
        return PlacedScan(scan, self._transforms.lookup(self._odom, self._base, scan.stamp), mount)

    def _mount(self, frame: str) -> Mount:
        if frame not in self._mounts:
            self._mounts[frame] = mount_of(self._transforms, self._base, frame)
        return self._mounts[frame]

    def _drop_when_old(self, entry: tuple[LaserScan, float], why: str) -> None:
        scan, arrival = entry
        if self._newest - scan.stamp > GIVE_UP_S or time.monotonic() - arrival > GIVE_UP_WALL_S:
            self._forget(entry)
            self.problem = why
            self.dropped += 1

    def _forget(self, entry: tuple[LaserScan, float]) -> None:
        with contextlib.suppress(ValueError, IndexError):  # a full queue or a clock set back was faster
            if self._waiting[0] is entry:
                self._waiting.popleft()
            else:
                self._waiting.remove(entry)
