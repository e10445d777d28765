"""How restless each room is: how often its sensor has called, and whether the lidar has seen something move there.

A sensor in a storm, or somebody who forges its calls, must not put a real call last. So a waiting room goes behind the
others the more often its sensor called before, and in front of them if something really moves there.
"""

from __future__ import annotations

import math

_HALF = 600.0  # time after which a call counts half [s]
_STIRS = 60.0  # time for which a movement counts [s]
_MOST = 1000.0  # calls


class Unrest:
    """Remembers calls and movements. Times are steady [s]."""

    def __init__(self) -> None:
        self._calls: dict[int, tuple[float, float]] = {}  # by room: their number when it was last counted, and then
        self._moved: dict[int, float] = {}

    def call(self, room_id: int, now: float) -> None:
        """Count a call of a room's sensor."""
        self._calls[room_id] = min(self._number(room_id, now) + 1.0, _MOST), now

    def calls(self, room_id: int, now: float) -> int:
        """Number of calls so far; older ones count less."""
        return round(self._number(room_id, now))

    def move(self, room_id: int, now: float) -> None:
        """Note that something moves in a room."""
        self._moved[room_id] = now

    def stirring(self, now: float) -> frozenset[int]:
        """Rooms in which something moved a moment ago."""
        return frozenset(room for room, at in self._moved.items() if now - at <= _STIRS)

    def _number(self, room_id: int, now: float) -> float:
        number, at = self._calls.get(room_id, (0.0, now))
        return number * math.pow(0.5, max(now - at, 0.0) / _HALF)
