"""Who moves around the robot, on ROS: scans in, and for whom a command has to wait."""

from __future__ import annotations

import rospy
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.control.give_way import GiveWay, GiveWayParams
from rosbot_patrol.control.movers import Mover, MoverParams, MoverWatch
from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.ros.messages.convert import scan_from_msg
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.node import now
from rosbot_patrol.ros.runtime.transforms import Transforms
from rosbot_patrol.scan import level_scan
from rosbot_patrol.scan_check import ScanCheck

LATEST = 1.0  # a scan older than that tells of nobody [s]


class People:
    """Watches a scan topic; everything but the callback is of one thread.

    Args:
        topic: of the scans; "" watches nobody.
        frame: of the odometry, in which the robot's way between two scans is known.
        transforms: the node's tf listener.
    """

    def __init__(
        self, topic: str, frame: str, transforms: Transforms, movers: MoverParams, give_way: GiveWayParams
    ) -> None:
        self._frame = frame
        self._transforms = transforms
        self._watch = MoverWatch(movers)
        self._give_way = GiveWay(give_way)
        self._scans: Latest[LaserScanMsg] = Latest()
        self._check = ScanCheck("nobody is waited for")
        if topic and give_way.horizon > 0.0:
            rospy.Subscriber(topic, LaserScanMsg, self._on_scan, queue_size=1, buff_size=2**18, tcp_nodelay=True)

    def look(self) -> None:
        """Take the newest scan, once its place is known."""
        message = self._scans.get()
        if message is None:
            return
        scan = scan_from_msg(message)
        if not self._check.accepts(scan, now()):
            self._scans.take()
            return
        try:
            level = level_scan(scan, self._transforms.transform(self._frame, scan.frame_id, scan.stamp), self._frame)
        except LaserTilted as err:
            self._check.refuse(str(err), now())
            self._scans.take()
            return
        except TransformError:
            return  # not yet: it is asked again with the next look
        self._scans.take()
        self._check.clear(now())
        self._watch.see(level.scan, level.pose)

    def waits(self, wish: Twist2D, odom_from_base: Pose2D, now: float) -> str:
        """For whom the robot has to wait instead of driving a velocity, "" for nobody."""
        return self._give_way.waits(wish, self.movers(now), odom_from_base, now)

    def movers(self, now: float) -> list[Mover]:
        """Who moves."""
        return self._watch.movers(now) if abs(now - self._watch.stamp) <= LATEST else []

    def _on_scan(self, message: LaserScanMsg) -> None:
        self._scans.set(message, 0.0)
