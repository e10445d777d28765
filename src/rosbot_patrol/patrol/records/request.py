"""A request for a mission: which room, for whom, since when."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any


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
