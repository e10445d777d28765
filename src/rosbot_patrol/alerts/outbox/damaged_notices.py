"""Replacement of notices that were damaged on the disk: made again from the incident's record, or told as lost."""

from __future__ import annotations

import re
from pathlib import Path

from rosbot_patrol.alerts.outbox.incident_notices import incident_notice, verdict_notice
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.safe_text import token
from rosbot_patrol.errors import StoreError

_INCIDENT = re.compile(r"\d{8}T\d{6}Z-\d+(-\d+)?")  # ids of missions, which only notices of intruders have
_VERDICT = "-verdict"
_PICTURE_NOTE = "attached, from the record: the notice was damaged on the disk"
_NO_PICTURE = "none: the notice was damaged on the disk, and the record has no picture"


def replacement(state_dir: Path, notice_id: str, wall: float) -> Notice:
    """A notice in place of a damaged one, with the same id, so that no channel takes it twice.

    Args:
        state_dir: holds the incidents.
        notice_id: of the damaged one.
        wall: now, seconds since 1970.
    """
    return _from_record(state_dir, notice_id) or _lost(notice_id, wall)


def _from_record(state_dir: Path, notice_id: str) -> Notice | None:
    try:
        with IncidentStore(state_dir, read_only=True) as store:
            incident = store.get(notice_id.removesuffix(_VERDICT))
            if incident is None or token(incident.id) != notice_id.removesuffix(_VERDICT):
                return None
            if notice_id.endswith(_VERDICT):
                return verdict_notice(incident)
            if not incident.object_class:
                return None  # the program ended before the record knew of somebody
            picture = _picture(store, incident)
            return incident_notice(incident, picture, picture_note=_PICTURE_NOTE if picture else _NO_PICTURE)
    except StoreError:
        return None


def _picture(store: IncidentStore, incident: Incident) -> bytes | None:
    for role in ("detection", "best", "after", "look"):
        for file in incident.files:
            if file.role == role and not store.folder.problem(incident.id, file):
                return store.folder.read(incident.id, file.name)
    return None


def _lost(notice_id: str, wall: float) -> Notice:
    is_incident = _INCIDENT.fullmatch(notice_id) is not None
    what = "Somebody was seen, and the notice about it" if is_incident else f"The notice {notice_id}, which waited,"
    return Notice(
        id=notice_id,
        wall=wall,
        kind="incident" if is_incident else "fault",
        subject="Somebody was seen" if is_incident else "rosbot patrol: a notice was damaged",
        text=f"{what} was damaged on the robot's disk before it could leave. Nothing more is known of it.\n\n"
        "Look at what `rosrun rosbot_patrol incidents list` shows of that time.",
        incident=notice_id if is_incident else "",
        verdict="confirmed" if is_incident else "",
    )
