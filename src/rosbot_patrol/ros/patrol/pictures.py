"""Ring of the camera's last pictures, filled only when needed; detects black and repeated pictures.

Somebody may be confirmed long after the picture that shows them best: such pictures are kept until then (`keep`).

A covered or hung camera still sends. A black picture counts as none; a picture that equals its predecessor byte for
byte is not new (a real camera's noise never repeats).
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence

import rospy
from sensor_msgs.msg import Image

from rosbot_patrol.alerts.pictures.jpeg import Picture, RawPicture
from rosbot_patrol.alerts.pictures.ring import EvidenceParams, EvidenceRing
from rosbot_patrol.ros.runtime.node import now

_SAMPLED = 211  # one byte of this many is checked: 4,367 of a picture of 640 x 480
_DARK = 40  # of 255: mean of a picture in little light
_BLACK = 12  # of 255: a covered camera's noise stays below
_MB = 1_000_000
_SAME = 0.002  # [s] stamps that differ by less are of one picture


class PictureRing:
    """Subscribe on `start`, clear on `stop`; find the picture of a detection.

    Args:
        topic: topic of the camera; "": none.
        params: number of pictures to keep.
    """

    def __init__(self, topic: str, params: EvidenceParams | None = None) -> None:
        self._topic = topic
        self._lock = threading.Lock()
        given = params or EvidenceParams()
        seconds = given.evidence_before + 1.0
        self._ring = EvidenceRing(seconds=seconds, rate=given.evidence_rate, max_bytes=given.evidence_mb * _MB)
        self._subscriber: rospy.Subscriber | None = None
        self._seen_at = self._changed_at = float("-inf")
        self._same: deque[float] = deque(maxlen=200)  # stamps of pictures equal to their predecessors
        self._same_since: float | None = None  # stamp of the first of the present series
        self._kept: dict[float, Picture] = {}  # by the stamps that are asked for
        self._is_dark = False

    @property
    def is_wanted(self) -> bool:
        """Whether there is a topic."""
        return bool(self._topic)

    @property
    def seen_at(self) -> float:
        """Arrival of the last picture since `start` that is not black [s], -inf before."""
        return self._seen_at

    @property
    def changed_at(self) -> float:
        """Arrival of the last picture since `start` that differs from its predecessor [s], -inf before."""
        return self._changed_at

    def is_same(self, stamp: float | None) -> bool:
        """Whether the picture at a time [s], None: the newest, is known to equal its predecessor byte for byte."""
        with self._lock:
            if self._same_since is not None and (stamp is None or stamp >= self._same_since):
                return True
            return stamp is not None and any(abs(stamp - same) <= _SAME for same in self._same)

    @property
    def is_dark(self) -> bool:
        """Whether the newest picture shows little light."""
        return self._is_dark

    def start(self) -> None:
        """Start collecting, if it has not started."""
        if self._topic and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self._topic, Image, self._store, queue_size=2, buff_size=1 << 23, tcp_nodelay=True
            )

    def stop(self) -> None:
        """Stop collecting and clear."""
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None
        with self._lock:
            self._ring.clear()
            self._kept.clear()
            self._same.clear()
            self._same_since = None
            self._seen_at = self._changed_at = float("-inf")

    def snapshot(self) -> EvidenceRing:
        """The present pictures, for slow threads."""
        with self._lock:
            return self._ring.snapshot()

    def find(self, stamp: float, tolerance: float = _SAME) -> Picture | None:
        """Picture nearest to a time [s], None if there is none within the tolerance."""
        with self._lock:
            near = [p for p in self._kept.values() if abs(p.stamp - stamp) <= tolerance]
            found = self._ring.find(stamp, tolerance)
            return min(near if found is None else [found, *near], key=lambda p: abs(p.stamp - stamp), default=None)

    def keep(self, stamps: Sequence[float]) -> None:
        """Keep the pictures of these times [s], however long, and no others."""
        if tuple(self._kept) == tuple(stamps):
            return
        with self._lock:
            found = ((stamp, self._kept.get(stamp) or self._ring.find(stamp, _SAME)) for stamp in stamps)
            self._kept = {stamp: picture for stamp, picture in found if picture is not None}

    def wait_for(self, stamp: float, seconds: float) -> Picture | None:
        """Call `find` repeatedly for some seconds of wall time; for threads that may wait."""
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
            self._is_dark = mean_of(data) < _DARK
            if not is_black(data):
                self._seen_at = now()
            self._ring.add(picture)


def mean_of(data: bytes) -> float:
    """Mean of some samples of a picture's bytes, 0 to 255."""
    samples = data[::_SAMPLED]
    return sum(samples) / max(len(samples), 1)


def is_black(data: bytes) -> bool:
    """Whether all samples of a picture's bytes are too dark to show anything."""
    return max(data[::_SAMPLED], default=0) < _BLACK
