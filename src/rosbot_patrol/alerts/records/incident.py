"""What happened: the record of one mission, as plain values."""

from __future__ import annotations

import dataclasses
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

NO_ROOM = -1  # of a place that is known and lies in no room
OPEN = ""  # the verdict of a mission that still runs
VERDICTS = ("confirmed", "clear", "unreachable", "unverified")

_NAME = re.compile(r"(?!\.)[A-Za-z0-9._+-]{1,120}")
_ON_THE_WAY = {"driving": "on the way to", "returning": "on the way back from"}
_CALLS = {
    "trigger": "a motion sensor in",
    "silent_sensor": "the silent motion sensor of",
    "schedule": "the schedule, for",
    "action": "a program, for",
    "all": "a person, for all rooms, among them",
}
_DOING = {"driving": "driving to", "looking": "looking around in", "returning": "coming home from"}


class Place(Enum):
    """Knowledge about a person's place."""

    CALLED = "in the room that called"
    OTHER = "in another room"
    OUTSIDE = "in no room of the map"
    UNKNOWN = "somewhere on the way"


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that was said or done during a mission.

    Attributes:
        wall: when, seconds since 1970.
        kind: sensor (its words), state (of the robot), seen, suspect, notice, verdict, fault, note.
        text: one sentence.
        data: further plain values, such as the sensor's id.
    """

    wall: float
    kind: str
    text: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class StoredFile:
    """A file of an incident's folder.

    Attributes:
        name: in that folder.
        role: detection (the notice's picture), best, before, after, clip, look, map, other.
        sha256: of its bytes, in hex; size: of it [bytes].
        stamp: time of a picture by the robot's clock [s]; None for other files.
        caption: for people.
    """

    name: str
    role: str
    sha256: str
    size: int
    stamp: float | None = None
    caption: str = ""


@dataclass(frozen=True, kw_only=True)
class Incident:
    """One mission, whatever came of it.

    Attributes:
        id: of its mission, with "-2" and so on for further persons elsewhere in the same mission.
        wall: when it began, seconds since 1970; ros_time: the same by the robot's clock [s].
        room_id, room_name: room that the robot was sent to.
        origin: reason of the mission: trigger, schedule, action, silent sensor, all.
        verdict: one of VERDICTS, OPEN while there is none; reason: in one sentence.
        phase: the robot's phase when it saw somebody first, or its last one: driving, looking, returning.
        times: (phase, wall) in the order in which the phases began.
        share_seen: seen share of the room's floor, 0 to 1; None if it was not measured.
        object_class, probability: of the detector, mean over `pictures`; "", 0 and 0 if nobody was confirmed.
        confirmed: when somebody was, seconds since 1970; sightings: confirmations in all.
        pose: x [m], y [m], yaw [rad] of the robot in map at that moment, None if unknown.
        person: x, y [m] of the person in map, None if unknown.
        person_room_id: number of the room with the person, NO_ROOM for none, None if unknown.
        person_room: name of that room.
        path: x, y [m] of the robot in map on its way.
        triggers: how often the room's sensor called.
        closed: when the record was completed, seconds since 1970; None while it is open.
        events: in the order in which they came.
        files: of its folder.
    """

    id: str
    wall: float
    room_id: int
    room_name: str
    ros_time: float = 0.0
    origin: str = "trigger"
    verdict: str = OPEN
    reason: str = ""
    phase: str = ""
    times: tuple[tuple[str, float], ...] = ()
    share_seen: float | None = None
    object_class: str = ""
    probability: float = 0.0
    pictures: int = 0
    confirmed: float | None = None
    sightings: int = 0
    pose: tuple[float, float, float] | None = None
    person: tuple[float, float] | None = None
    person_room_id: int | None = None
    person_room: str = ""
    path: tuple[tuple[float, float], ...] = ()
    triggers: int = 1
    closed: float | None = None
    events: tuple[Event, ...] = ()
    files: tuple[StoredFile, ...] = ()

    @property
    def room(self) -> str:
        """Number and name."""
        return f"room {self.room_id} ({self.room_name})" if self.room_name else f"room {self.room_id}"

    @property
    def place(self) -> Place:
        """Knowledge about the person's place."""
        if not self.object_class:
            return Place.CALLED
        if self.person_room_id == NO_ROOM:
            return Place.OUTSIDE
        if self.person_room_id is not None:
            return Place.CALLED if self.person_room_id == self.room_id else Place.OTHER
        if self.person_room:
            return Place.CALLED if self.person_room in (self.room_name, self.room) else Place.OTHER
        return Place.UNKNOWN if self.phase in _ON_THE_WAY else Place.CALLED

    @property
    def where(self) -> str:
        """Where the person is, as far as that is known; else the room that the robot was sent to."""
        place = self.place
        if place is Place.OTHER:
            return self.person_title
        if place is Place.OUTSIDE:
            return f"in no room of the map, near {self.room}"
        return f"{_ON_THE_WAY[self.phase]} {self.room}" if place is Place.UNKNOWN else self.room

    @property
    def person_title(self) -> str:
        """The room with the person, with its number if that is known; "" for none."""
        is_numbered = self.person_room_id not in (None, NO_ROOM)
        return f"room {self.person_room_id} ({self.person_room})" if is_numbered else self.person_room

    @property
    def call(self) -> str:
        """What sent the robot to its room."""
        return f"{_CALLS.get(self.origin, self.origin)} {self.room}"

    @property
    def sentence(self) -> str:
        """For people."""
        if self.object_class:
            place = {Place.OTHER: f" in {self.where}", Place.OUTSIDE: " in no room of the map"}.get(self.place, "")
            doing = f"while {_DOING.get(self.phase, self.phase)} {self.room}"
            return f"{self.object_class} seen{place} {doing}, probability {self.probability:.2f}"
        return f"{self.room}: {self.verdict or 'the mission runs'}{f', {self.reason}' if self.reason else ''}"

    def durations(self) -> tuple[tuple[str, float], ...]:
        """How long each phase took [s]; the last one until the record was closed."""
        ends = [wall for _, wall in self.times[1:]] + ([self.closed] if self.closed is not None else [])
        return tuple((phase, end - wall) for (phase, wall), end in zip(self.times, ends, strict=False))


def is_name(text: str) -> bool:
    """Whether a text can be the name of an incident's folder or of a file in it."""
    return bool(_NAME.fullmatch(text))


def incident_to_plain(incident: Incident) -> dict[str, Any]:
    """The record for JSON."""
    return dataclasses.asdict(incident)


def incident_from_plain(plain: Mapping[str, Any]) -> Incident:
    """The record of `incident_to_plain`; fields that a later version added are left out.

    Raises:
        KeyError, TypeError, ValueError: this is no record.
    """
    known = {f.name for f in dataclasses.fields(Incident)}
    values: dict[str, Any] = {key: value for key, value in plain.items() if key in known}
    for key in ("pose", "person"):
        values[key] = tuple(map(float, values[key])) if values.get(key) else None
    values["times"] = tuple((str(phase), float(wall)) for phase, wall in values.get("times", ()))
    values["path"] = tuple((float(x), float(y)) for x, y in values.get("path", ()))
    values["events"] = tuple(Event(**event) for event in values.get("events", ()))
    values["files"] = tuple(StoredFile(**file) for file in values.get("files", ()))
    return Incident(**values)


def clock_text(wall: float) -> str:
    """A time for people, in the robot's time zone."""
    return time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(wall))
