"""A link that is not what it should be: frames come late, in their order, or not at all, and the link breaks.

The caller gives the time; the seed makes the choices the same again.
"""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LinkQuality:
    """What a link does to frames; the defaults are a perfect one.

    Attributes:
        loss: part of the frames that get lost, 0 to 1.
        delay: time that each frame takes [s]; jitter: longest time on top of it [s].
        drop_every: mean time between two breaks of the link [s], 0: it holds.
    """

    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    drop_every: float = 0.0
    seed: int = 0


PERFECT = LinkQuality()


class PoorLink:
    """Frames on their way.

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
        """Be a new connection: nothing is on its way."""
        self._frames.clear()
        self._plan_break(now)

    def change(self, quality: LinkQuality, now: float) -> None:
        """Be another link from now on; what is on its way stays so."""
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
        """Frames that have arrived by now, in the order in which they were sent."""
        arrived = []
        while self._frames and self._frames[0][0] <= now:
            arrived.append(self._frames.popleft()[1])
        return arrived

    def breaks(self, now: float) -> bool:
        """Whether the link breaks, since this was last asked; what was on its way is lost."""
        if now < self._breaks_at:
            return False
        self.begin(now)
        return True

    @property
    def next_event(self) -> float:
        """When the next frame arrives or the link breaks [s], inf for never."""
        return min(self._frames[0][0] if self._frames else math.inf, self._breaks_at)

    def _plan_break(self, now: float) -> None:
        every = self.quality.drop_every
        self._breaks_at = now + self._random.expovariate(1.0 / every) if every else math.inf
