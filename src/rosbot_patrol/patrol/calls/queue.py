"""What asks for a room to be looked at.

The rooms that wait for a mission: one entry a room, the most urgent first, in order of arrival among equals.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from rosbot_patrol.params import param


class Origin(Enum):
    """What called for a mission."""

    TRIGGER = "trigger"
    ACTION = "action"
    ALL = "all"
    SILENT_SENSOR = "silent_sensor"
    SCHEDULE = "schedule"


@dataclass(frozen=True, kw_only=True)
class Request:
    """A room that something asks to be looked at.

    Attributes:
        room_id: which.
        origin: what asks; note: more about it, for people.
        wall: when, in seconds since 1970.
        priority: greater goes first.
        id: of the mission that it will be.
        triggers: how often its sensor called.
        times: what the mission has spent already, where it was put back (see Mission.times).
    """

    room_id: int
    origin: Origin = Origin.TRIGGER
    note: str = ""
    wall: float = 0.0
    priority: int = 0
    id: str = ""
    triggers: int = 1
    times: Mapping[str, float] = dataclasses.field(default_factory=dict)


def request_to_plain(request: Request) -> dict[str, Any]:
    """For JSON."""
    return {**dataclasses.asdict(request), "origin": request.origin.value, "times": dict(request.times)}


def request_from_plain(plain: Mapping[str, Any]) -> Request:
    """The request of `request_to_plain`.

    Raises:
        KeyError, TypeError, ValueError: this is no request.
    """
    return Request(
        room_id=int(plain["room_id"]),
        origin=Origin(plain["origin"]),
        note=str(plain["note"]),
        wall=float(plain["wall"]),
        priority=int(plain["priority"]),
        id=str(plain["id"]),
        triggers=int(plain["triggers"]),
        times={str(name): float(seconds) for name, seconds in plain["times"].items()},
    )


@dataclass(frozen=True, kw_only=True)
class PriorityParams:
    """Who goes first: a greater number does."""

    priority_trigger: int = param(40, lo=0, hi=100, doc="of a room whose motion sensor called; greater goes first")
    priority_action: int = param(30, lo=0, hi=100, doc="of a room that a program or a person asked for")
    priority_silent_sensor: int = param(20, lo=0, hi=100, doc="of a room whose sensor has gone silent")
    priority_schedule: int = param(10, lo=0, hi=100, doc="of a room of a scheduled round")
    preempt: bool = param(
        True, doc="a motion sensor's call puts the look of a round or at a silent sensor back into the queue"
    )

    def of(self, origin: Origin) -> int:
        """The priority of what an origin asks for."""
        return {
            Origin.TRIGGER: self.priority_trigger,
            Origin.ACTION: self.priority_action,
            Origin.ALL: self.priority_action,
            Origin.SILENT_SENSOR: self.priority_silent_sensor,
            Origin.SCHEDULE: self.priority_schedule,
        }[origin]


class MissionQueue:
    """Requests that wait."""

    def __init__(self) -> None:
        self._waiting: dict[int, Request] = {}

    def add(self, request: Request) -> bool:
        """Queue a request; False where its room waits already: then the more urgent of the two counts."""
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
        """Queue a request before all others of its priority."""
        others = {room: kept for room, kept in self._waiting.items() if room != request.room_id}
        self._waiting = {request.room_id: request, **others}

    def find(self, room_id: int) -> Request | None:
        """What waits for a room."""
        return self._waiting.get(room_id)

    def pop(self) -> Request:
        """The most urgent, among equals the one that waits longest."""
        first = next(iter(self))
        return self._waiting.pop(first.room_id)

    def drop(self, *origins: Origin) -> list[Request]:
        """Take out what these origins asked for; all where none is named."""
        dropped = [request for request in self if not origins or request.origin in origins]
        for request in dropped:
            del self._waiting[request.room_id]
        return dropped

    @property
    def rooms(self) -> tuple[int, ...]:
        """Ids of the rooms, the next first."""
        return tuple(request.room_id for request in self)

    def __iter__(self) -> Iterator[Request]:
        return iter(sorted(self._waiting.values(), key=lambda request: -request.priority))

    def __len__(self) -> int:
        return len(self._waiting)
