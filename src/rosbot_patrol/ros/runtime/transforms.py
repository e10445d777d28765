"""tf: planar look-ups that never wait, through one listener per node."""

from __future__ import annotations

import numpy as np
import rospy
import tf2_ros
from numpy.typing import NDArray
from tf2_msgs.msg import TFMessage

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, Transform


class _Listener(tf2_ros.TransformListener):
    """A listener that also records which node published each frame."""

    def __init__(self, buffer: tf2_ros.Buffer) -> None:
        self.publishers: dict[str, tuple[str, str]] = {}  # frame: (its parent, name of the node that publishes it)
        super().__init__(buffer, tcp_nodelay=True)

    def callback(self, data: TFMessage) -> None:
        """Store dynamic transforms."""
        super().callback(data)
        who = data._connection_header.get("callerid", "")
        for each in data.transforms:
            self.publishers[each.child_frame_id.lstrip("/")] = (each.header.frame_id.lstrip("/"), who)

    def connected(self) -> set[str]:
        """Names of the nodes that publish transforms; rospy drops a connection as soon as its other end dies."""
        return {getattr(connection, "callerid_pub", "") for connection in self.tf_sub.impl.connections}


class Transforms:
    """Look-up of planar transforms; frames may have tf1's leading slash."""

    def __init__(self, cache_s: float = 10.0) -> None:
        self.buffer = tf2_ros.Buffer(rospy.Duration.from_sec(cache_s))
        self._listener = _Listener(self.buffer)

    def departed(self, frame: str) -> str:
        """Publishers of a frame's position, or of a frame above it, that have died, as a sentence; else empty.

        This is known much earlier than the age of a transform shows: within milliseconds on one host.
        """
        connected = self._listener.connected()
        frame, seen = frame.lstrip("/"), set[str]()
        while frame in self._listener.publishers and frame not in seen:
            parent, who = self._listener.publishers[frame]
            if who and who not in connected:
                return f"{who} has gone, which told where '{frame}' is in '{parent}'"
            seen.add(frame)
            frame = parent
        return ""

    def transform(self, target: str, source: str, stamp: float | None = None) -> Transform:
        """Look up `target_from_source` in space at a time [s], the newest for None.

        Raises:
            TransformError: it is unknown, or unknown at that time.
        """
        when = rospy.Time(0) if stamp is None else rospy.Time.from_sec(stamp)
        return self._find(target, source, when)[0]

    def lookup(self, target: str, source: str, stamp: float | None = None) -> Pose2D:
        """Look up the planar part of `transform`; raises TransformError."""
        return self.transform(target, source, stamp).pose

    def lookup_matrix(self, target: str, source: str, stamp: float) -> NDArray[np.float64]:
        """`target_from_source` in space at a time [s], shape (4, 4); raises TransformError."""
        return self.transform(target, source, stamp).matrix

    def lookup_stamped(self, target: str, source: str) -> tuple[Pose2D, float]:
        """Look up the newest `target_from_source` and its stamp [s], 0 if nothing moves; raises TransformError."""
        found, stamp = self._find(target, source, rospy.Time(0))
        return found.pose, stamp

    def _find(self, target: str, source: str, when: rospy.Time) -> tuple[Transform, float]:
        try:
            found = self.buffer.lookup_transform_core(target.lstrip("/"), source.lstrip("/"), when)
        except tf2_ros.TransformException as err:
            raise TransformError(target, source, str(err)) from err
        t, q = found.transform.translation, found.transform.rotation
        return Transform(t.x, t.y, t.z, q.x, q.y, q.z, q.w), found.header.stamp.to_sec()
