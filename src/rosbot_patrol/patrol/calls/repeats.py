"""What has been said a moment ago, so that a sender in a loop does not flood the log."""

from __future__ import annotations

import math


class Repeats:
    """Remembers when something was last said about each room.

    Args:
        period: so long nothing more is said about it [s].
    """

    def __init__(self, period: float = 10.0) -> None:
        self._period = period
        self._said: dict[int, float] = {}

    def is_news(self, room_id: int, now: float) -> bool:
        """Whether to say it now; if so it counts as said. `now` may go back."""
        if 0.0 <= now - self._said.get(room_id, -math.inf) < self._period:
            return False
        self._said[room_id] = now
        return True
