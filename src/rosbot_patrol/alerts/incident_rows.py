"""Rows of the incidents' database; all but reading within a transaction."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts import chain
from rosbot_patrol.alerts.incident import Event, Incident, Place, StoredFile, incident_from_plain, incident_to_plain
from rosbot_patrol.errors import StoreError

MAX_EVENTS = 2000  # of one record
WORDS = 4000  # characters of a record that are searched


def head_of(connection: sqlite3.Connection) -> tuple[int, str]:
    """Number and hash of the last link; (0, START) before the first."""
    row = connection.execute("SELECT n, hash FROM links ORDER BY n DESC LIMIT 1").fetchone()
    return (row["n"], row["hash"]) if row else (0, chain.START)


def append_link(
    connection: sqlite3.Connection, kind: str, incident_id: str, wall: float, body: Mapping[str, Any]
) -> chain.Link:
    """Add a link to the chain."""
    link = chain.make_link(head_of(connection), kind, incident_id, wall, chain.canonical(body))
    connection.execute(
        "INSERT INTO links VALUES (:n, :kind, :incident, :wall, :body, :digest, :previous, :hash)", vars(link)
    )
    return link


def insert_incident(connection: sqlite3.Connection, incident: Incident) -> None:
    """A row for an open record, where there is none of its id."""
    newest = connection.execute("SELECT max(wall) FROM incidents").fetchone()[0]
    is_late = newest is not None and incident.wall < newest
    values = {**columns_of(incident), "record": chain.canonical(_without_lists(incident)), "late": int(is_late)}
    names = ", ".join(values)
    marks = ", ".join(f":{name}" for name in values)
    connection.execute(f"INSERT OR IGNORE INTO incidents ({names}) VALUES ({marks})", values)


def update_incident(connection: sqlite3.Connection, incident: Incident) -> None:
    """Write an open record anew."""
    _update(connection, incident, record=chain.canonical(_without_lists(incident)))


def insert_event(connection: sqlite3.Connection, incident_id: str, event: Event) -> None:
    """Add an event to an open record; the one after MAX_EVENTS says that there were more."""
    count = connection.execute("SELECT count(*) FROM events WHERE incident=?", (incident_id,)).fetchone()[0]
    if count > MAX_EVENTS:
        return
    if count == MAX_EVENTS:
        event = Event(wall=event.wall, kind="note", text=f"more than {MAX_EVENTS} events came; the others are not kept")
    connection.execute(
        "INSERT INTO events (incident, wall, kind, text, data) VALUES (?, ?, ?, ?, ?)",
        (incident_id, event.wall, clean(event.kind), clean(event.text), chain.canonical(event.data)),
    )


def insert_file(connection: sqlite3.Connection, incident_id: str, file: StoredFile) -> None:
    """A row for a file of an open record."""
    values = {**vars(file), "caption": clean(file.caption), "incident": incident_id}
    connection.execute(
        "INSERT OR REPLACE INTO files VALUES (:incident, :name, :role, :sha256, :size, :stamp, :caption)", values
    )


def close_incident(connection: sqlite3.Connection, incident: Incident, wall: float) -> chain.Link:
    """Move a record, complete with events and files, into the chain."""
    link = append_link(connection, chain.RECORD, incident.id, wall, incident_to_plain(incident))
    _update(connection, incident, record=None, link=link.n)
    connection.execute("DELETE FROM events WHERE incident=?", (incident.id,))
    connection.execute("DELETE FROM files WHERE incident=?", (incident.id,))
    return link


def columns_of(incident: Incident) -> dict[str, Any]:
    """What lists and searches need of a record."""
    words = [incident.id, incident.room_name, incident.person_room, incident.object_class, incident.verdict]
    if incident.place is Place.OTHER:
        words.insert(0, person_tag(incident.person_room_id))
    words += [incident.reason, incident.origin, *(event.text for event in incident.events)]
    return {
        "id": incident.id,
        "wall": incident.wall,
        "room_id": incident.room_id,
        "room_name": clean(incident.room_name),
        "origin": clean(incident.origin),
        "verdict": clean(incident.verdict),
        "reason": clean(incident.reason),
        "share": incident.share_seen,
        "object_class": clean(incident.object_class),
        "closed": incident.closed,
        "bytes": sum(file.size for file in incident.files),
        "tags": " ".join([room_tag(incident.room_id), verdict_tag(incident.verdict)]),
        "words": clean(" ".join(words))[:WORDS],
    }


def room_tag(room_id: int) -> str:
    """A word of the text index for a room."""
    return f"room{room_id}".replace("-", "minus")


def person_tag(room_id: int | None) -> str:
    """A word of the text index for the room in which somebody was, where another one had called."""
    return f"inroom{room_id}"


def verdict_tag(verdict: str) -> str:
    """A word of the text index for a verdict."""
    return f"verdict{''.join(filter(str.isalnum, verdict)) or 'open'}"


def record_from_json(path: Path, incident_id: str, text: str | None) -> Incident:
    """The record of a JSON text. Raises StoreError."""
    try:
        return incident_from_plain(json.loads(text or ""))
    except (ValueError, TypeError, KeyError, AttributeError) as err:
        raise StoreError(path, f"the record '{incident_id}' makes no sense: {err!r}; see 'incidents verify'") from err


def clean(text: str) -> str:
    """The text without what SQLite cannot hold."""
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "\ufffd")


def _without_lists(incident: Incident) -> dict[str, Any]:
    return incident_to_plain(replace(incident, events=(), files=()))


def _update(connection: sqlite3.Connection, incident: Incident, **more: Any) -> None:
    values = {**columns_of(incident), **more}
    changes = ", ".join(f"{name}=:{name}" for name in values)
    connection.execute(f"UPDATE incidents SET {changes} WHERE id=:id", values)
