"""The camera's last pictures, kept only while a mission runs."""

from __future__ import annotations

import threading
import time
from collections import deque

import rospy
from sensor_msgs.msg import Image

from rosbot_patrol.alerts.picture import RawPicture
from rosbot_patrol.ros.node import now


class PictureRing:
    """Subscribes on `start`, forgets on `stop`; finds the picture that a detection speaks of.

    Args:
        topic: of the camera; "" for none.
        length: how many pictures to keep (0.9 MB each at 640 x 480).
    """

    def __init__(self, topic: str, length: int = 30) -> None:
        self._topic = topic
        self._lock = threading.Lock()
        self._ring: deque[Image] = deque(maxlen=length)
        self._subscriber: rospy.Subscriber | None = None
        self._seen_at = float("-inf")

    @property
    def is_wanted(self) -> bool:
        """There is a topic to look at."""
        return bool(self._topic)

    @property
    def seen_at(self) -> float:
        """When the last picture came since `start` [s], -inf before."""
        return self._seen_at

    def start(self) -> None:
        """Begin to collect, where it does not yet."""
        if self._topic and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self._topic, Image, self._store, queue_size=2, buff_size=1 << 23, tcp_nodelay=True
            )

    def stop(self) -> None:
        """Stop collecting and forget."""
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None
        with self._lock:
            self._ring.clear()
            self._seen_at = float("-inf")

    def find(self, stamp: float, tolerance: float = 0.002) -> RawPicture | None:
        """The picture nearest to a time [s], None where none lies within the tolerance."""
        with self._lock:
            best = min(self._ring, key=lambda m: abs(m.header.stamp.to_sec() - stamp), default=None)
        if best is None or abs(best.header.stamp.to_sec() - stamp) > tolerance:
            return None
        return RawPicture(
            stamp=best.header.stamp.to_sec(),
            width=best.width,
            height=best.height,
            encoding=best.encoding,
            step=best.step,
            data=bytes(best.data),
        )

    def wait_for(self, stamp: float, seconds: float) -> RawPicture | None:
        """`find`, again and again for some seconds of wall time; for threads that may wait."""
        deadline = time.monotonic() + seconds
        while True:
            found = self.find(stamp)
            if found is not None or time.monotonic() > deadline:
                return found
            time.sleep(0.02)

    def _store(self, message: Image) -> None:
        with self._lock:
            if self._subscriber is not None:
                self._ring.append(message)
                self._seen_at = now()
