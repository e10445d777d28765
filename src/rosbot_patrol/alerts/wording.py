"""What a notice about an incident says. Matches the tutorial's subject and first sentence."""

from __future__ import annotations

import time

from rosbot_patrol.alerts.incident import Incident
from rosbot_patrol.alerts.mail import token
from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.counts import count_of

SUBJECT = "rosbot patrol node"
FIRST_SENTENCE = "I have found something strange it could be invader"


def incident_notice(incident: Incident, picture: bytes | None, *, picture_note: str = "") -> Notice:
    """The notice of a confirmed intruder.

    Args:
        incident: what happened.
        picture: JPEG, None where there is none.
        picture_note: what to say about the picture, or why there is none.
    """
    return Notice(
        id=token(incident.id),
        wall=_moment(incident),
        kind="incident",
        subject=SUBJECT,
        text=f"{FIRST_SENTENCE}.",
        facts=_facts(incident, picture_note),
        room_id=incident.room_id,
        room_name=incident.room_name,
        verdict=incident.verdict,
        incident=incident.id,
        picture=picture,
        picture_name=f"room{incident.room_id}-{token(incident.id)}.jpg",
    )


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
        ("Room", f"{incident.room_id} ({incident.room_name})"),
        ("Time", f"{when} (robot's clock {incident.ros_time:.1f} s)"),
        ("Verdict", incident.verdict),
        ("Seen", seen),
        ("Why", incident.reason),
    ]
    if incident.person is not None:
        x, y = incident.person
        inside = f", in {incident.person_room}" if incident.person_room else ""
        rows.append(("Person", f"x {x:.1f} m, y {y:.1f} m in the map{inside}"))
    if incident.pose is not None:
        x, y, yaw = incident.pose
        rows.append(("Robot", f"x {x:.2f} m, y {y:.2f} m, heading {yaw:.2f} rad in the map"))
    return (*rows, ("Picture", picture_note or "attached"), ("Incident", incident.id))


def _moment(incident: Incident) -> float:
    return incident.wall if incident.confirmed is None else incident.confirmed
