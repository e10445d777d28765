"""Inputs that a callback stores and a step reads."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """The newest value of an input and the time it was stored; thread-safe."""

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
        """Take the newest value; the next call returns None until another comes."""
        with self._lock:
            value, self._value = self._value, None
            return value

    @property
    def stamp(self) -> float:
        """Time when the newest value was stored [s], -inf before the first."""
        return self._stamp

    @property
    def count(self) -> int:
        """Number of values received."""
        return self._count

    def fresh(self, now: float, timeout: float) -> bool:
        """Whether the newest value is at most `timeout` [s] old.

        A value that came after `now` was read is fresh. A clock that went back by more than the time-out counts as
        stale.
        """
        return self._value is not None and abs(now - self._stamp) <= timeout


def drain(source: deque[T]) -> list[T]:
    """Take all values of a queue, while others may append to it."""
    items = []
    while source:
        items.append(source.popleft())
    return items
