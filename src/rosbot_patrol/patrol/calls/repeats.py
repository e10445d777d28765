"""Recently logged messages, so that a sender in a loop does not flood the log."""

from __future__ import annotations

import math


class Repeats:
    """Remembers when a message about each room was last logged.

    Args:
        period: minimum time between two messages about a room [s].
    """

    def __init__(self, period: float = 10.0) -> None:
        self._period = period
        self._said: dict[int, float] = {}

    def is_news(self, room_id: int, now: float) -> bool:
        """Whether to log it now; if so it counts as logged. `now` may go back."""
        if 0.0 <= now - self._said.get(room_id, -math.inf) < self._period:
            return False
        self._said[room_id] = now
        return True
