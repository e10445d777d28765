"""tf at the edge: planar look-ups that never wait, and one listener a node."""

from __future__ import annotations

import rospy
import tf2_ros

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, yaw_from_quaternion


class Transforms:
    """Looks up planar transforms; frames may carry tf1's leading slash."""

    def __init__(self, cache_s: float = 10.0) -> None:
        self.buffer = tf2_ros.Buffer(rospy.Duration.from_sec(cache_s))
        self._listener = tf2_ros.TransformListener(self.buffer, tcp_nodelay=True)

    def lookup(self, target: str, source: str, stamp: float | None = None) -> Pose2D:
        """`target_from_source` at a time [s], or the newest.

        Raises:
            TransformError: it is not known, or not at that time.
        """
        when = rospy.Time(0) if stamp is None else rospy.Time.from_sec(stamp)
        try:
            found = self.buffer.lookup_transform(target.lstrip("/"), source.lstrip("/"), when)
        except tf2_ros.TransformException as err:
            raise TransformError(target, source, str(err)) from err
        t, q = found.transform.translation, found.transform.rotation
        return Pose2D(t.x, t.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))

    def lookup_stamped(self, target: str, source: str) -> tuple[Pose2D, float]:
        """The newest `target_from_source` and its stamp [s]; raises TransformError."""
        try:
            found = self.buffer.lookup_transform(target.lstrip("/"), source.lstrip("/"), rospy.Time(0))
        except tf2_ros.TransformException as err:
            raise TransformError(target, source, str(err)) from err
        t, q = found.transform.translation, found.transform.rotation
        return Pose2D(t.x, t.y, yaw_from_quaternion(q.x, q.y, q.z, q.w)), found.header.stamp.to_sec()
