"""The depth pictures of the patrol's camera, and the lenses of both: listened to only while somebody wants them.

A depth picture of 640 x 480 is 1.2 MB: at ten a second they would cost more than all the rest of the patrol.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from dataclasses import replace

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image

from rosbot_patrol.errors import ImageError
from rosbot_patrol.patrol.intruder.measure import Depth, Lens
from rosbot_patrol.ros.messages.images import picture_from_msg
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health

log = logging.getLogger(__name__)

_SAME = 0.06  # a depth picture of that time is of the same moment [s]
_STARTING = 3.0  # so long after it was asked for depth may need to come from whoever publishes it, wall time [s]
_NOBODY = 1.0  # so long until it is clear that nobody does, wall time [s]
_KEEP = 8.0  # so long after the last box depth is listened to, wall time [s]
_GIVE_UP = 60.0  # so long a depth camera that is silent is not asked again, wall time [s]


class Lenses:
    """The lens of a camera, of its first camera_info."""

    def __init__(self, topic: str) -> None:
        self.lens: Lens | None = None
        self.frame = ""
        self._subscriber = rospy.Subscriber(topic, CameraInfo, self._on_info, queue_size=1) if topic else None

    def _on_info(self, message: CameraInfo) -> None:
        k = message.K
        if message.width <= 0 or message.height <= 0 or k[0] <= 0.0 or k[4] <= 0.0:
            log.warning("a camera_info of width %d and focal length %g tells no lens", message.width, k[0])
            return
        self.frame = message.header.frame_id.lstrip("/")
        self.lens = Lens(fx=k[0], fy=k[4], cx=k[2], cy=k[5], width=message.width, height=message.height)
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None


class DepthRing:
    """The last depth pictures, listened to only while somebody wants them."""

    def __init__(self, topic: str, info_topic: str, health: Health) -> None:
        self._topic, self._health = rospy.resolve_name(topic) if topic else "", health
        self._lens = Lenses(info_topic if topic else "")
        self._lock = threading.Lock()
        self._ring: deque[Image] = deque(maxlen=6)
        self._subscriber: rospy.Subscriber | None = None
        self._asked = self._wanted = self._silent_since = float("-inf")
        self._problem = ""

    def want(self, wall: float) -> None:
        """Somebody needs depth about now."""
        self._wanted = wall
        if self._topic and self._subscriber is None and wall - self._silent_since > _GIVE_UP:
            self._asked = wall
            self._subscriber = rospy.Subscriber(
                self._topic, Image, self._store, queue_size=2, buff_size=1 << 23, tcp_nodelay=True
            )

    def tend(self, wall: float, *, is_over: bool = False) -> None:
        """Stop listening where nobody needs it any more or nothing comes."""
        if self._subscriber is None:
            return
        connected = self._subscriber.get_num_connections() > 0
        silent = not self._ring and wall - self._asked > (_STARTING if connected else _NOBODY)
        if silent:
            self._silent_since = wall
            log.warning(
                "%s: no depth comes; the lidar and the boxes tell places, and posters are not told", self._topic
            )
            self._health.set("depth", WARN, f"nothing comes on {self._topic}")
        if silent or is_over or wall - self._wanted > _KEEP:
            self._subscriber.unregister()
            with self._lock:
                self._subscriber = None
                self._ring.clear()

    @property
    def is_on(self) -> bool:
        """Whether depth is listened to."""
        return self._subscriber is not None

    def may_come(self, stamp: float) -> bool:
        """Whether the depth of a moment [s] is still to be waited for."""
        newest = self._newest()
        return self._subscriber is not None and (newest is None or newest < stamp)

    def is_flowing(self, stamp: float) -> bool:
        """Whether depth comes, or is about to, so that a picture of a moment [s] without it proves nothing."""
        newest = self._newest()
        return self._subscriber is not None and (newest is None or stamp - newest < _STARTING)

    def _newest(self) -> float | None:
        with self._lock:
            return self._ring[-1].header.stamp.to_sec() if self._ring else None

    def find(self, stamp: float, colour: Lens) -> Depth | None:
        """The depth picture of a moment [s], None where there is none or it cannot be read."""
        with self._lock:
            best = min(self._ring, key=lambda m: abs(m.header.stamp.to_sec() - stamp), default=None)
        if best is None or abs(best.header.stamp.to_sec() - stamp) > _SAME:
            return None
        try:
            metres = _metres(best)
        except ImageError as err:
            if str(err) != self._problem:
                log.error("%s: %s", self._topic, err)
            self._problem = str(err)
            return None
        self._health.set("depth", OK, "depth comes where it is asked for")
        return Depth(metres, self._lens.lens or replace(colour, width=best.width, height=best.height))

    def _store(self, message: Image) -> None:
        with self._lock:
            if self._subscriber is not None:
                self._ring.append(message)


def _metres(message: Image) -> NDArray[np.float32]:
    picture = picture_from_msg(message)
    if picture.encoding not in ("32FC1", "16UC1", "mono16"):
        raise ImageError(f"pictures are {picture.encoding}, expected depth as 32FC1 or 16UC1")
    pixels = picture.pixels[:, :, 0]
    if picture.encoding == "32FC1":
        return np.asarray(pixels, np.float32)
    return np.where(pixels > 0, pixels * np.float32(0.001), np.float32(np.nan))
