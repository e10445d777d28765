"""The depth pictures of the patrol's camera, wanted only while somebody is measured.

A depth picture of 640 x 480 is 1.2 MB: at ten a second they would cost more than all the rest of the patrol.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import unpack
from rosbot_patrol.patrol.intruder.measure import Depth, Lens
from rosbot_patrol.patrol.senses.health import OK, WARN, Health
from rosbot_patrol.patrol.senses.records import ImageRecord, LensRecord

log = logging.getLogger(__name__)

KEPT = 6  # depth pictures
_SAME = 0.06  # largest time between two pictures of the same moment [s]
_STARTING = 3.0  # longest time that a publisher needs before its first picture [s]
_NOBODY = 1.0  # time after which a missing publisher is known to be missing [s]
_KEEP = 8.0  # time for which depth stays wanted after the last box [s]
_GIVE_UP = 60.0  # time for which a silent depth camera is not asked again [s]


class DepthRing:
    """Keeps the last depth pictures, while somebody wants them. Times are of the steady clock, stamps of ROS time.

    Args:
        topic: of the pictures, for messages; "" if there is no depth camera.
        health: told whether depth comes.

    Attributes:
        is_on: whether depth is wanted, so that the node has to listen.
    """

    def __init__(self, topic: str, health: Health) -> None:
        self._topic, self._health = topic, health
        self._lens: Lens | None = None
        self._ring: deque[ImageRecord] = deque(maxlen=KEPT)
        self._asked = self._wanted = self._silent_since = -math.inf
        self._problem = ""
        self.is_on = False

    def hear_lens(self, record: LensRecord) -> None:
        """Take the depth camera's lens; the first counts."""
        self._lens = self._lens or record.lens

    def hear(self, picture: ImageRecord) -> None:
        """Take a depth picture; nobody wants it while depth is off."""
        if self.is_on:
            self._ring.append(picture)

    def want(self, steady: float) -> None:
        """Note that somebody needs depth about now [s]."""
        self._wanted = steady
        if self._topic and not self.is_on and steady - self._silent_since > _GIVE_UP:
            self._asked, self.is_on = steady, True

    def tend(self, steady: float, *, is_over: bool, has_publisher: bool) -> None:
        """Switch depth off if nobody needs it any more or nothing comes.

        Args:
            steady: time [s].
            is_over: no mission runs.
            has_publisher: somebody publishes on the topic.
        """
        if not self.is_on:
            return
        is_silent = not self._ring and steady - self._asked > (_STARTING if has_publisher else _NOBODY)
        if is_silent:
            self._silent_since = steady
            rest = "the lidar and the boxes tell places, and posters are not told"
            log.warning("%s: no depth comes; %s", self._topic, rest)
            self._health.set("depth", WARN, f"nothing comes on {self._topic}")
        if is_silent or is_over or steady - self._wanted > _KEEP:
            self.is_on = False
            self._ring.clear()

    def may_come(self, stamp: float) -> bool:
        """Tell whether the depth of a moment [s] is still to be waited for."""
        newest = self._newest()
        return self.is_on and (newest is None or newest < stamp)

    def is_flowing(self, stamp: float) -> bool:
        """Tell whether depth comes, or is about to: then a picture of a moment [s] without depth proves nothing."""
        newest = self._newest()
        return self.is_on and (newest is None or stamp - newest < _STARTING)

    def find(self, stamp: float, colour: Lens) -> Depth | None:
        """Find the depth picture of a moment [s]; None if there is none or it cannot be read.

        Args:
            stamp: of the colour picture [s].
            colour: lens of the colour camera, which serves if the depth camera's is not known.
        """
        best = min(self._ring, key=lambda each: abs(each.stamp - stamp), default=None)
        if best is None or abs(best.stamp - stamp) > _SAME:
            return None
        try:
            metres = _metres(best)
        except ImageError as err:
            if str(err) != self._problem:
                log.error("%s: %s", self._topic, err)
            self._problem = str(err)
            return None
        self._health.set("depth", OK, "depth comes where it is asked for")
        return Depth(metres, self._lens or replace(colour, width=best.width, height=best.height))

    def _newest(self) -> float | None:
        return self._ring[-1].stamp if self._ring else None


def _metres(record: ImageRecord) -> NDArray[np.float32]:
    """Distances along the optical axis [m], shape (H, W), NaN if unknown; raises ImageError."""
    picture = unpack(
        record.data,
        record.encoding,
        width=record.width,
        height=record.height,
        step=record.step,
        big_endian=record.is_big_endian,
    )
    if picture.encoding not in ("32FC1", "16UC1", "mono16"):
        raise ImageError(f"pictures are {picture.encoding}, expected depth as 32FC1 or 16UC1")
    pixels = picture.pixels[:, :, 0]
    if picture.encoding == "32FC1":
        return np.asarray(pixels, np.float32)
    return np.where(pixels > 0, pixels * np.float32(0.001), np.float32(np.nan))
