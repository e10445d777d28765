"""Exchange of values between callbacks, which store, and steps, which read."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """The newest value of an input, with the time it was stored; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._value: T | None = None
        self._stamp = float("-inf")
        self._count = 0

    def set(self, value: T, stamp: float) -> None:
        """Store a value seen at `stamp` [s]."""
        with self._lock:
            self._value, self._stamp, self._count = value, stamp, self._count + 1

    def get(self) -> T | None:
        """The newest value, None before the first."""
        return self._value

    def take(self) -> T | None:
        """Remove and return the newest value."""
        with self._lock:
            value, self._value = self._value, None
            return value

    @property
    def stamp(self) -> float:
        """When the newest value was stored [s], -inf before the first."""
        return self._stamp

    @property
    def count(self) -> int:
        """Number of values stored so far."""
        return self._count

    def fresh(self, now: float, timeout: float) -> bool:
        """Whether the newest value is at most `timeout` [s] old.

        One that came after `now` was read is fresh; a clock that went back by more than the time-out counts as stale.
        """
        return self._value is not None and abs(now - self._stamp) <= timeout


def drain(source: deque[T]) -> list[T]:
    """Take everything from a queue, while others may append to it."""
    items = []
    while source:
        items.append(source.popleft())
    return items
