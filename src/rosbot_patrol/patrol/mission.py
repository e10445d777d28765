"""Missions, the rooms that wait for one, and what of them outlives the program."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from rosbot_patrol.patrol.rooms import Room, Rooms
from rosbot_patrol.patrol.watch import Confirmation


class Phase(Enum):
    """What the patrol does; the values are those of PatrolState."""

    STARTING = "starting"
    IDLE = "idle"
    DRIVING = "driving"
    LOOKING = "looking"
    RETURNING = "returning"


class Verdict(Enum):
    """How a mission ends."""

    CONFIRMED = "confirmed"
    CLEAR = "clear"
    UNREACHABLE = "unreachable"
    UNVERIFIED = "unverified"


@dataclass(kw_only=True)
class Mission:
    """One trigger on its way to a verdict.

    Attributes:
        id: unlike any other's, sorts by time.
        room: to be looked at.
        phase: DRIVING, LOOKING or RETURNING.
        started: [s]; arrived, looked: end of the drive and of the look [s], None before.
        wall: start in seconds since 1970.
        verdict: None until there is one; reason: of it, one sentence.
        notified: its one notice is on disk.
        sightings: confirmations in all; best: the surest.
        triggers: how often the room's sensor called, the first time with it.
    """

    id: str
    room: Room
    phase: Phase = Phase.DRIVING
    started: float = 0.0
    wall: float = 0.0
    arrived: float | None = None
    looked: float | None = None
    verdict: Verdict | None = None
    reason: str = ""
    notified: bool = False
    sightings: int = 0
    best: Confirmation | None = field(default=None, repr=False)
    triggers: int = 1


class MissionQueue:
    """Rooms that wait for a mission: one entry a room, in order of arrival."""

    def __init__(self) -> None:
        self._waiting: dict[int, int] = {}

    def add(self, room_id: int) -> bool:
        """Queue a room; False where it waits already (its count of triggers grows)."""
        is_new = room_id not in self._waiting
        self._waiting[room_id] = self._waiting.get(room_id, 0) + 1
        return is_new

    def pop(self) -> tuple[int, int]:
        """The room that waits longest, and how often it was triggered."""
        room_id = next(iter(self._waiting))
        return room_id, self._waiting.pop(room_id)

    @property
    def rooms(self) -> tuple[int, ...]:
        """Ids in order of arrival."""
        return tuple(self._waiting)

    def __bool__(self) -> bool:
        return bool(self._waiting)


def mission_id(wall: float, count: int) -> str:
    """An id from the time of day [s since 1970] and a running number."""
    return f"{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime(wall))}-{count}"


def mission_to_plain(mission: Mission) -> dict[str, Any]:
    """What has to outlive the program, for JSON."""
    return {
        "id": mission.id,
        "room": mission.room.id,
        "phase": mission.phase.value,
        "wall": mission.wall,
        "verdict": mission.verdict.value if mission.verdict else "",
        "reason": mission.reason,
        "notified": mission.notified,
        "sightings": mission.sightings,
        "triggers": mission.triggers,
    }


def mission_from_plain(plain: Mapping[str, Any], rooms: Rooms) -> Mission | None:
    """The mission of `mission_to_plain`; None where its room is gone from the points file.

    A look that was interrupted starts over: the mission drives again.

    Raises:
        KeyError, TypeError, ValueError: this is no mission.
    """
    room = rooms.find(int(plain["room"]))
    if room is None:
        return None
    phase = Phase(plain["phase"])
    return Mission(
        id=str(plain["id"]),
        room=room,
        phase=Phase.RETURNING if phase is Phase.RETURNING else Phase.DRIVING,
        wall=float(plain["wall"]),
        verdict=Verdict(plain["verdict"]) if plain["verdict"] else None,
        reason=str(plain["reason"]),
        notified=bool(plain["notified"]),
        sightings=int(plain["sightings"]),
        triggers=int(plain["triggers"]),
    )
