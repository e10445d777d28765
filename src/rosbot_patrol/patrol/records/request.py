"""Request for a mission: room, origin, time."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any


class Origin(Enum):
    """Origin of a mission."""

    TRIGGER = "trigger"
    ACTION = "action"
    ALL = "all"
    SILENT_SENSOR = "silent_sensor"
    SCHEDULE = "schedule"


@dataclass(frozen=True, kw_only=True)
class Request:
    """A request to search a room.

    Attributes:
        room_id: id of the room.
        origin: of the request; note: details, for people.
        wall: time in seconds since 1970.
        priority: the greatest goes first.
        id: of its future mission.
        triggers: number of calls of its sensor.
        earlier: number of calls of its sensor before this one; fewer go first.
        times: time spent before the mission was put back (see Mission.times).
    """

    room_id: int
    origin: Origin = Origin.TRIGGER
    note: str = ""
    wall: float = 0.0
    priority: int = 0
    id: str = ""
    triggers: int = 1
    earlier: int = 0
    times: Mapping[str, float] = dataclasses.field(default_factory=dict)


def request_to_plain(request: Request) -> dict[str, Any]:
    """Contents for JSON."""
    return {**dataclasses.asdict(request), "origin": request.origin.value, "times": dict(request.times)}


def request_from_plain(plain: Mapping[str, Any]) -> Request:
    """Request from the result of `request_to_plain`.

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
        earlier=int(plain.get("earlier", 0)),  # records of 1.0 have none
        times={str(name): float(seconds) for name, seconds in plain["times"].items()},
    )
