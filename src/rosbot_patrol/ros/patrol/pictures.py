"""The camera's last pictures, kept only while they are wanted, and whether they show anything.

A camera that is covered or hung still sends: a picture that is black counts as none, and one that is the one before,
byte for byte, is no new one (a real camera's noise is never twice the same).
"""

from __future__ import annotations

import threading
import time
from collections import deque

import rospy
from sensor_msgs.msg import Image

from rosbot_patrol.alerts.pictures.jpeg import Picture, RawPicture
from rosbot_patrol.alerts.pictures.ring import EvidenceParams, EvidenceRing
from rosbot_patrol.ros.runtime.node import now

_SAMPLED = 211  # one byte of so many is looked at: 4,367 of a picture of 640 x 480
_BLACK = 12  # of 255: a covered camera's noise stays below
_MB = 1_000_000


class PictureRing:
    """Subscribes on `start`, forgets on `stop`; finds the picture that a detection speaks of.

    Args:
        topic: of the camera; "" for none.
        params: how many pictures to keep.
    """

    def __init__(self, topic: str, params: EvidenceParams | None = None) -> None:
        self._topic = topic
        self._lock = threading.Lock()
        given = params or EvidenceParams()
        seconds = given.evidence_before + 1.0
        self._ring = EvidenceRing(seconds=seconds, rate=given.evidence_rate, max_bytes=given.evidence_mb * _MB)
        self._subscriber: rospy.Subscriber | None = None
        self._seen_at = self._changed_at = float("-inf")
        self._same: deque[float] = deque(maxlen=200)  # stamps of pictures that are the one before
        self._same_since: float | None = None  # and of the first of those that go on until now

    @property
    def is_wanted(self) -> bool:
        """There is a topic to look at."""
        return bool(self._topic)

    @property
    def seen_at(self) -> float:
        """When the last picture came since `start` that is not black [s], -inf before."""
        return self._seen_at

    @property
    def changed_at(self) -> float:
        """When the last picture came since `start` that differs from the one before [s], -inf before."""
        return self._changed_at

    def is_same(self, stamp: float | None) -> bool:
        """Whether the picture of a time [s], None for the newest, is known to be the one before, byte for byte."""
        with self._lock:
            if self._same_since is not None and (stamp is None or stamp >= self._same_since):
                return True
            return stamp is not None and any(abs(stamp - same) <= 0.002 for same in self._same)

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
            self._same.clear()
            self._same_since = None
            self._seen_at = self._changed_at = float("-inf")

    def snapshot(self) -> EvidenceRing:
        """What is there now, for threads that take their time."""
        with self._lock:
            return self._ring.snapshot()

    def find(self, stamp: float, tolerance: float = 0.002) -> Picture | None:
        """The picture nearest to a time [s], None where none lies within the tolerance."""
        with self._lock:
            return self._ring.find(stamp, tolerance)

    def wait_for(self, stamp: float, seconds: float) -> Picture | None:
        """`find`, again and again for some seconds of wall time; for threads that may wait."""
        deadline = time.monotonic() + seconds
        while True:
            found = self.find(stamp)
            if found is not None or time.monotonic() > deadline:
                return found
            time.sleep(0.02)

    def _store(self, message: Image) -> None:
        data = bytes(message.data)
        picture = RawPicture(
            stamp=message.header.stamp.to_sec(),
            width=message.width,
            height=message.height,
            encoding=message.encoding,
            step=message.step,
            data=data,
        )
        with self._lock:
            if self._subscriber is None:
                return
            newest = self._ring.newest
            if newest is None or data != newest.data:
                self._changed_at, self._same_since = now(), None
            else:
                self._same.append(picture.stamp)
                self._same_since = picture.stamp if self._same_since is None else self._same_since
            if not is_black(data):
                self._seen_at = now()
            self._ring.add(picture)


def is_black(data: bytes) -> bool:
    """Whether no sample of a picture's bytes is bright enough to show anything."""
    return max(data[::_SAMPLED], default=0) < _BLACK
