"""Supervision of a camera's stream: silent or frozen, and since when."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Stream(enum.Enum):
    """State of a stream of pictures."""

    WAITING = "no picture yet"
    FLOWING = "pictures come in"
    STOPPED = "pictures have stopped"
    FROZEN = "pictures do not change"


@dataclass
class StreamWatch:
    """Supervises one stream of pictures, in seconds of a clock that does not stop (not simulated time).

    Args:
        timeout: silence after which it counts as stopped [s].
        frozen_timeout: time of unchanging pictures after which it counts as frozen [s]; 0: never.
    """

    timeout: float
    frozen_timeout: float
    _last: float | None = None
    _changed: float = 0.0
    _rate: float = 0.0
    _content: object = None

    def note(self, now: float, content: object) -> None:
        """Record a picture; equal contents mean that nothing has changed."""
        fresh = self._last is None or not 0.0 <= now - self._last <= self.timeout
        if fresh or content != self._content:
            self._changed = now
        if self._last is not None and now > self._last:
            gap = now - self._last
            self._rate = 1.0 / gap if gap > self.timeout or not self._rate else 0.9 * self._rate + 0.1 / gap
        self._last, self._content = now, content

    @property
    def rate(self) -> float:
        """Pictures per second, smoothed."""
        return self._rate

    def state(self, now: float) -> Stream:
        """State of the stream."""
        if self._last is None:
            return Stream.WAITING
        if now - self._last > self.timeout:
            return Stream.STOPPED
        if self.frozen_timeout and now - self._changed > self.frozen_timeout:
            return Stream.FROZEN
        return Stream.FLOWING

    def silent_for(self, now: float) -> float:
        """Seconds since the last picture, 0 before the first."""
        return 0.0 if self._last is None else now - self._last
