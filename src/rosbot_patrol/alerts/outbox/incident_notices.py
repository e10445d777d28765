"""What a notice about an incident says: what and where first, as a phone's lock screen shows no more."""

from __future__ import annotations

import time
from typing import Any

from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.records.incident import Incident, Place
from rosbot_patrol.alerts.safe_text import one_line, token
from rosbot_patrol.counts import count_of


def incident_notice(incident: Incident, picture: bytes | None, *, picture_note: str = "") -> Notice:
    """The notice of a confirmed intruder.

    Args:
        incident: the record.
        picture: JPEG, None if there is none.
        picture_note: a remark about the picture, or why there is none.
    """
    return Notice(
        id=token(incident.id),
        wall=_moment(incident),
        kind="incident",
        subject=title(incident),
        text=_text(incident),
        facts=_facts(incident, picture_note),
        **_rooms(incident),
        verdict=incident.verdict,
        incident=incident.id,
        picture=picture,
        picture_name=f"{_picture_place(incident)}-{token(incident.id)}.jpg",
    )


def _rooms(incident: Incident) -> dict[str, Any]:
    """The room with the person, and the room that called if that is another one."""
    if incident.place is Place.CALLED:
        return {"room_id": incident.room_id, "room_name": incident.room_name}
    called = {"called_id": incident.room_id, "called_name": incident.room_name}
    if incident.place is Place.OTHER and incident.person_room_id is not None:
        return {"room_id": incident.person_room_id, "room_name": incident.person_room, **called}
    if incident.place is Place.OTHER:
        return {"room_name": incident.person_room, "place": incident.person_room, **called}
    return {"room_id": incident.room_id, "room_name": incident.room_name, "place": incident.where, **called}


def _picture_place(incident: Incident) -> str:
    if incident.place is Place.CALLED:
        return f"room{incident.room_id}"
    is_numbered = incident.place is Place.OTHER and incident.person_room_id is not None
    return f"room{incident.person_room_id}" if is_numbered else "person"


def title(incident: Incident) -> str:
    """One line, such as "Person in corridor hall, 06:00"."""
    names = {Place.CALLED: incident.room_name, Place.OTHER: incident.person_room}
    name = names.get(incident.place) or incident.where
    when = time.strftime("%H:%M", time.localtime(_moment(incident)))
    return _sentence(f"{incident.object_class} {_in(incident)}{name}, {when}")


def _text(incident: Incident) -> str:
    seen = _sentence(f"{incident.object_class} seen {_in(incident)}{incident.where}.")
    return seen if incident.place is Place.CALLED else f"{seen}\nCalled by {one_line(incident.call)}."


def _in(incident: Incident) -> str:
    return "in " if incident.place in (Place.CALLED, Place.OTHER) else ""


def _sentence(text: str) -> str:
    line = one_line(text).lstrip(" .")
    return f"{line[:1].upper()}{line[1:]}"


def verdict_notice(incident: Incident) -> Notice:
    """The notice of how a mission ended in which nobody was seen."""
    share = "" if incident.share_seen is None else f"{100.0 * incident.share_seen:.0f} % of the floor"
    rows = [
        ("Room", f"{incident.room_id} ({incident.room_name})"),
        ("Time", time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(incident.wall))),
        ("Verdict", incident.verdict),
        ("Why", incident.reason),
        ("Seen", share),
        ("Incident", incident.id),
    ]
    return Notice(
        id=f"{token(incident.id)}-verdict",
        wall=incident.wall,
        kind="verdict",
        subject=f"rosbot patrol: {incident.room}: {incident.verdict}",
        text=_VERDICTS.get(incident.verdict, "A patrol is over."),
        facts=tuple((name, value) for name, value in rows if value),
        room_id=incident.room_id,
        room_name=incident.room_name,
        verdict=incident.verdict,
        incident=incident.id,
    )


_VERDICTS = {
    "clear": "The robot looked, and nobody was there.",
    "unreachable": "The robot could not get into the room, so nobody knows whether somebody is there.",
    "unverified": "The robot was there but could not be sure: somebody may be there.",
}


def _facts(incident: Incident, picture_note: str) -> tuple[tuple[str, str], ...]:
    when = time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(_moment(incident)))
    pictures = count_of(incident.pictures, "picture")
    seen = f"{incident.object_class}, probability {incident.probability:.2f}, in {pictures}"
    rows = [
        *_room_rows(incident),
        ("Time", f"{when} (robot's clock {incident.ros_time:.1f} s)"),
        ("Verdict", incident.verdict),
        ("Seen", seen),
        ("Why", incident.reason),
    ]
    if incident.person is not None:
        x, y = incident.person
        inside = f", in {incident.person_title}" if incident.person_room else ""
        rows.append(("Person", f"x {x:.1f} m, y {y:.1f} m in the map{inside}"))
    if incident.pose is not None:
        x, y, yaw = incident.pose
        rows.append(("Robot", f"x {x:.2f} m, y {y:.2f} m, heading {yaw:.2f} rad in the map"))
    return (*rows, ("Picture", picture_note or "attached"), ("Incident", incident.id))


def _room_rows(incident: Incident) -> list[tuple[str, str]]:
    called = f"{incident.room_id} ({incident.room_name})"
    if incident.place is Place.CALLED:
        return [("Room", called)]
    is_known = incident.place is Place.OTHER
    return [
        ("Room", incident.where.removeprefix("room ") if is_known else incident.where),
        ("Caller", incident.call),
    ]


def _moment(incident: Incident) -> float:
    return incident.wall if incident.confirmed is None else incident.confirmed
