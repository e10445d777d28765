"""Messages that are logged once each, and never in a flood."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable


def printable(text: str, limit: int = 200) -> str:
    """Text from a stranger in one line without control characters, fit for a log."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[:limit])
    return shown + ("..." if len(text) > limit else "")


class Complaints:
    """Remembers messages; each is repeated only after `period` [s], and memory is bounded.

    Args:
        period: how long a complaint is not repeated [s].
        capacity: number of remembered messages; the oldest is forgotten first.
    """

    def __init__(self, period: float = 600.0, capacity: int = 1000) -> None:
        self._period = period
        self._capacity = capacity
        self._said: OrderedDict[Hashable, float] = OrderedDict()
        self.left_out = False
        self._minutes: OrderedDict[Hashable, tuple[float, int]] = OrderedDict()

    def is_new(self, key: Hashable, now: float) -> bool:
        """Whether a message should be logged now; if so it counts as logged."""
        said = self._said.get(key)
        if said is not None and 0.0 <= now - said < self._period:
            return False
        self._said[key] = now
        self._said.move_to_end(key)
        if len(self._said) > self._capacity:
            self._said.popitem(last=False)
        return True

    def may_speak(self, group: Hashable, now: float, limit: int = 60) -> bool:
        """Count a line about `group`; returns whether it is among the first `limit` of its minute.

        `left_out` tells that this line is the first one beyond the limit.
        """
        began, count = self._minutes.get(group, (now, 0))
        if not 0.0 <= now - began < 60.0:
            began, count = now, 0
        self._minutes[group] = (began, count + 1)
        self._minutes.move_to_end(group)
        if len(self._minutes) > self._capacity:
            self._minutes.popitem(last=False)
        self.left_out = count == limit
        return count < limit
