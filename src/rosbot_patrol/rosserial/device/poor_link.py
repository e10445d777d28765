"""A simulated poor link: frames are delayed (in order) or lost, and the link breaks.

The caller passes the time; with the same seed the choices are the same.
"""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LinkQuality:
    """Quality of a link; the defaults are a perfect one.

    Attributes:
        loss: share of frames that are lost, 0 to 1.
        delay: delay of each frame [s]; jitter: maximum additional delay [s].
        drop_every: mean time between two breaks of the link [s]; 0: none.
    """

    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    drop_every: float = 0.0
    seed: int = 0


PERFECT = LinkQuality()


class PoorLink:
    """Frames under way on a poor link.

    Args:
        quality: of the link.
        now: time at which it begins [s].
    """

    def __init__(self, quality: LinkQuality, now: float) -> None:
        self.quality = quality
        self._random = random.Random(quality.seed)
        self._frames: deque[tuple[float, bytes]] = deque()
        self._breaks_at = math.inf
        self._plan_break(now)

    def begin(self, now: float) -> None:
        """Start a new connection: no frame is under way."""
        self._frames.clear()
        self._plan_break(now)

    def change(self, quality: LinkQuality, now: float) -> None:
        """Change the quality from now on; frames under way keep their arrival times."""
        if quality != self.quality:
            self.quality, self._random = quality, random.Random(quality.seed)
            self._plan_break(now)

    def put(self, frame: bytes, now: float) -> None:
        """Send a frame."""
        q = self.quality
        if q.loss and self._random.random() < q.loss:
            return
        due = now + q.delay + (self._random.uniform(0.0, q.jitter) if q.jitter else 0.0)
        if self._frames:
            due = max(due, self._frames[-1][0])
        self._frames.append((due, frame))

    def take(self, now: float) -> list[bytes]:
        """Frames that have arrived by now, in the order of sending."""
        arrived = []
        while self._frames and self._frames[0][0] <= now:
            arrived.append(self._frames.popleft()[1])
        return arrived

    def breaks(self, now: float) -> bool:
        """Whether the link has broken since the last call; frames under way are lost."""
        if now < self._breaks_at:
            return False
        self.begin(now)
        return True

    @property
    def next_event(self) -> float:
        """Time of the next arrival or break [s], inf: never."""
        return min(self._frames[0][0] if self._frames else math.inf, self._breaks_at)

    def _plan_break(self, now: float) -> None:
        every = self.quality.drop_every
        self._breaks_at = now + self._random.expovariate(1.0 / every) if every else math.inf
