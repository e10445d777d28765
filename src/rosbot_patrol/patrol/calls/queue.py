"""Mission queue: one entry per waiting room, the most urgent first.

Among rooms of one priority, movement counts first, then fewer calls before, then the longer wait.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

from rosbot_patrol.params import param
from rosbot_patrol.patrol.records.request import Origin, Request


@dataclass(frozen=True, kw_only=True)
class PriorityParams:
    """Priorities of the mission queue; the greatest number goes first."""

    priority_trigger: int = param(
        40, lo=0, hi=100, doc="priority of a motion sensor's call; the greatest number goes first"
    )
    priority_action: int = param(30, lo=0, hi=100, doc="priority of a request by a program or a person")
    priority_silent_sensor: int = param(20, lo=0, hi=100, doc="priority of a look at a room with a silent sensor")
    priority_schedule: int = param(10, lo=0, hi=100, doc="priority of a scheduled round")
    preempt: bool = param(
        True, doc="a motion sensor's call sends a scheduled look, or a look at a silent sensor, back to the queue"
    )

    def of(self, origin: Origin) -> int:
        """Priority of requests from an origin."""
        return {
            Origin.TRIGGER: self.priority_trigger,
            Origin.ACTION: self.priority_action,
            Origin.ALL: self.priority_action,
            Origin.SILENT_SENSOR: self.priority_silent_sensor,
            Origin.SCHEDULE: self.priority_schedule,
        }[origin]


class MissionQueue:
    """Waiting requests.

    Attributes:
        stirring: rooms in which something moves.
    """

    def __init__(self) -> None:
        self.stirring: frozenset[int] = frozenset()
        self._waiting: dict[int, Request] = {}

    def add(self, request: Request) -> bool:
        """Queue a request; False if its room is waiting already: then the more urgent one counts."""
        kept = self._waiting.get(request.room_id)
        if kept is None:
            self._waiting[request.room_id] = request
            return True
        calls = kept.triggers + request.triggers
        if request.priority > kept.priority:
            kept = dataclasses.replace(kept, origin=request.origin, note=request.note, priority=request.priority)
        self._waiting[request.room_id] = dataclasses.replace(kept, triggers=calls)
        return False

    def put_back(self, request: Request) -> None:
        """Queue a request in front of all others of its priority."""
        others = {room: kept for room, kept in self._waiting.items() if room != request.room_id}
        self._waiting = {request.room_id: dataclasses.replace(request, earlier=-1), **others}

    def find(self, room_id: int) -> Request | None:
        """Waiting request of a room."""
        return self._waiting.get(room_id)

    def pop(self) -> Request:
        """Remove and return the most urgent request."""
        first = next(iter(self))
        return self._waiting.pop(first.room_id)

    def remove(self, request: Request) -> None:
        """Remove a waiting request. Raises KeyError."""
        del self._waiting[request.room_id]

    def drop(self, *origins: Origin) -> list[Request]:
        """Remove the requests of these origins; all if none is named."""
        dropped = [request for request in self if not origins or request.origin in origins]
        for request in dropped:
            del self._waiting[request.room_id]
        return dropped

    @property
    def rooms(self) -> tuple[int, ...]:
        """Ids of the rooms, the next first."""
        return tuple(request.room_id for request in self)

    def __iter__(self) -> Iterator[Request]:
        return iter(sorted(self._waiting.values(), key=self._rank))

    def _rank(self, request: Request) -> tuple[int, bool, int]:
        return -request.priority, request.room_id not in self.stirring, request.earlier

    def __len__(self) -> int:
        return len(self._waiting)
