"""Missions: one room to be searched, from the call to the verdict."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.records.findings import Confirmation
from rosbot_patrol.patrol.records.request import Origin

View = tuple[float, float, float]  # x [m], y [m], yaw [rad] in map


class Phase(Enum):
    """Phase of the patrol; values are those of PatrolState."""

    STARTING = "starting"
    IDLE = "idle"
    DRIVING = "driving"
    LOOKING = "looking"
    RETURNING = "returning"
    STOPPED = "stopped"


class Verdict(Enum):
    """Verdict of a mission."""

    CONFIRMED = "confirmed"
    CLEAR = "clear"
    UNREACHABLE = "unreachable"
    UNVERIFIED = "unverified"


@dataclass(kw_only=True)
class Mission:
    """One call on its way to a verdict.

    Attributes:
        id: unique, sorts by time.
        room: to be searched.
        origin: what called for it; priority: greater goes first; called: when, in seconds since 1970; note: by whom,
            for people.
        phase: DRIVING, LOOKING or RETURNING.
        started: steady time [s]; arrived, looked: end of the drive and of the look likewise, None before.
        wall: start in seconds since 1970.
        verdict: None until there is one; reason: of it, one sentence.
        notified: its one notice is on disk.
        sightings: number of confirmations; best: the surest one.
        triggers: how often the room's sensor called, the first time with it.
        times: seconds spent waiting, driving, looking and returning, by name.
        began: when each of these began first, in seconds since 1970.
        views_done: poses from which the room was looked at in a full turn.
        share_seen: of the room's floor, 0 to 1, None if unknown.
        place: x, y in map [m] of the person who was confirmed first, then; None where it is not known.
        place_room: the room that lies in, None where it lies in none or nobody knows.
        is_outside: that place lies in no room of the map.
        people: where each of those met was last, likewise; each of them gets a notice.
        own_motion: rooms whose sensor called while the robot passed them, with seconds since 1970: not followed.
    """

    id: str
    room: Room
    origin: Origin = Origin.TRIGGER
    priority: int = 0
    called: float = 0.0
    note: str = ""
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
    times: dict[str, float] = field(default_factory=dict)
    began: dict[str, float] = field(default_factory=dict)
    views_done: list[View] = field(default_factory=list)
    share_seen: float | None = None
    place: tuple[float, float] | None = None
    place_room: Room | None = None
    is_outside: bool = False
    people: list[tuple[float, float] | None] = field(default_factory=list)
    own_motion: list[tuple[float, int]] = field(default_factory=list)

    @property
    def verdict_name(self) -> str:
        """Value of the verdict, "" before there is one."""
        return self.verdict.value if self.verdict else ""


def mission_id(wall: float, count: int) -> str:
    """Id from the time of day [s since 1970] and a running number."""
    return f"{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime(wall))}-{count}"


def mission_to_plain(mission: Mission) -> dict[str, Any]:
    """State that must survive a restart, for JSON."""
    return {
        "id": mission.id,
        "room": mission.room.id,
        "origin": mission.origin.value,
        "priority": mission.priority,
        "called": mission.called,
        "note": mission.note,
        "phase": mission.phase.value,
        "wall": mission.wall,
        "verdict": mission.verdict_name,
        "reason": mission.reason,
        "notified": mission.notified,
        "sightings": mission.sightings,
        "triggers": mission.triggers,
        "times": dict(mission.times),
        "began": dict(mission.began),
        "views_done": [list(view) for view in mission.views_done],
        "share_seen": mission.share_seen,
        "place": list(mission.place) if mission.place else None,
        "place_room": mission.place_room.id if mission.place_room else None,
        "is_outside": mission.is_outside,
        "people": [list(place) if place else None for place in mission.people],
        "own_motion": [list(item) for item in mission.own_motion],
    }


def mission_from_plain(plain: Mapping[str, Any], rooms: Rooms) -> Mission | None:
    """Mission from the result of `mission_to_plain`; None if its room is no longer in the points file.

    Raises:
        KeyError, TypeError, ValueError: this is no mission.
    """
    room = rooms.find(int(plain["room"]))
    if room is None:
        return None
    place = plain["place"]
    share = plain["share_seen"]
    place_room = plain.get("place_room")  # like the next one, missing in files of earlier versions
    return Mission(
        id=str(plain["id"]),
        room=room,
        origin=Origin(plain["origin"]),
        priority=int(plain["priority"]),
        called=float(plain["called"]),
        note=str(plain["note"]),
        phase=Phase(plain["phase"]),
        wall=float(plain["wall"]),
        verdict=Verdict(plain["verdict"]) if plain["verdict"] else None,
        reason=str(plain["reason"]),
        notified=bool(plain["notified"]),
        sightings=int(plain["sightings"]),
        triggers=int(plain["triggers"]),
        times={str(name): float(seconds) for name, seconds in plain["times"].items()},
        began={str(name): float(wall) for name, wall in plain["began"].items()},
        views_done=[(float(x), float(y), float(yaw)) for x, y, yaw in plain["views_done"]],
        share_seen=None if share is None else float(share),
        place=None if place is None else (float(place[0]), float(place[1])),
        place_room=None if place_room is None else rooms.find(int(place_room)),
        is_outside=bool(plain.get("is_outside", False)),
        people=[None if each is None else (float(each[0]), float(each[1])) for each in plain["people"]],
        own_motion=[(float(wall), int(room_id)) for wall, room_id in plain["own_motion"]],
    )
