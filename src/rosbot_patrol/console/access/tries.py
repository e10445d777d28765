"""A limit on wrong passwords and codes: after some, each further try has to wait twice as long as the one before."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

_FORGET = 3600.0  # [s] without a failure after which a key starts anew
_MOST = 10_000  # keys


@dataclass
class _Failures:
    count: int
    last: float


class Tries:
    """Failures by key, such as an address or a name.

    Args:
        free: failures that cost no time.
        first: [s] to wait after those; doubled by each further one.
        most: [s] longest wait.
    """

    def __init__(self, *, free: int, first: float = 1.0, most: float = 900.0) -> None:
        self._free, self._first, self._most = free, first, most
        self._failures: OrderedDict[str, _Failures] = OrderedDict()

    def wait(self, key: str, now: float) -> float:
        """Time until a key may try again [s], 0 if it may now."""
        found = self._failures.get(key)
        if found is None or found.count <= self._free:
            return 0.0
        pause = min(self._first * 2.0 ** min(found.count - self._free - 1, 30), self._most)
        return max(found.last + pause - now, 0.0)

    def fail(self, key: str, now: float) -> None:
        """Count a failure."""
        found = self._failures.pop(key, None)
        count = 1 if found is None or now - found.last > _FORGET else found.count + 1
        self._failures[key] = _Failures(count, now)
        while len(self._failures) > _MOST:
            self._failures.popitem(last=False)

    def succeed(self, key: str) -> None:
        """Forget a key's failures."""
        self._failures.pop(key, None)
