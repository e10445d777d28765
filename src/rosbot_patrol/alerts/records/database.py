"""The incidents' SQLite file: tables, rows, and opening.

WAL, so that people read while the robot writes; synchronous=FULL, so that what a call wrote is on the disk when it
returns. Tables:

- links: the chain (rosbot_patrol.alerts.records.chain). A closed record is the body of its link, byte for byte.
- incidents: what lists and searches need of each record, and the whole of those that are open.
- events, files: of open records only; they move into the link's body on closing.
- incidents_text: an FTS5 index over two columns of incidents. `late` marks rows that began, by the clock, before one
  that was there already (the clock had jumped): all others are in the order of time, so that a search finds the rows of
  a time span without looking at each.

A file of a later version is never written: a new one is begun beside it, with this version in its name. One of an
earlier version, or one that makes no sense, is renamed and never deleted.

Functions that write rows are called within a transaction.
"""

from __future__ import annotations

import errno
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.incident import (
    Event,
    Incident,
    Place,
    StoredFile,
    incident_from_plain,
    incident_to_plain,
)
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import DISK_FULL

VERSION = 2
APPLICATION_ID = 0x52504149  # "RPAI"
NAME = "incidents.sqlite"
FOLDER = "incidents"
BUSY_TIMEOUT = 5.0  # [s] to wait for another writer

_SCHEMA = """
CREATE TABLE links (
  n INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, incident TEXT NOT NULL, wall REAL NOT NULL,
  body TEXT, digest TEXT NOT NULL, previous TEXT NOT NULL, hash TEXT NOT NULL);
CREATE INDEX links_incident ON links(incident);
CREATE TABLE incidents (
  seq INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, wall REAL NOT NULL, room_id INTEGER NOT NULL,
  room_name TEXT NOT NULL, origin TEXT NOT NULL, verdict TEXT NOT NULL, reason TEXT NOT NULL, share REAL,
  object_class TEXT NOT NULL, closed REAL, link INTEGER, bytes INTEGER NOT NULL DEFAULT 0,
  tags TEXT NOT NULL, words TEXT NOT NULL, record TEXT, late INTEGER NOT NULL DEFAULT 0);
CREATE INDEX incidents_wall ON incidents(wall);
CREATE INDEX incidents_room ON incidents(room_id, wall);
CREATE INDEX incidents_verdict ON incidents(verdict, wall);
CREATE INDEX incidents_both ON incidents(room_id, verdict, wall);
CREATE INDEX incidents_open ON incidents(seq) WHERE closed IS NULL;
CREATE INDEX incidents_in_order ON incidents(wall) WHERE late = 0;
CREATE INDEX incidents_late ON incidents(wall) WHERE late = 1;
CREATE TABLE events (
  n INTEGER PRIMARY KEY, incident TEXT NOT NULL, wall REAL NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL,
  data TEXT NOT NULL);
CREATE INDEX events_incident ON events(incident);
CREATE TABLE files (
  incident TEXT NOT NULL, name TEXT NOT NULL, role TEXT NOT NULL, sha256 TEXT NOT NULL, size INTEGER NOT NULL,
  stamp REAL, caption TEXT NOT NULL, PRIMARY KEY (incident, name));
CREATE VIRTUAL TABLE incidents_text USING fts5(
  tags, words, content='incidents', content_rowid='seq', tokenize='unicode61 remove_diacritics 2', prefix='2 3');
CREATE TRIGGER incidents_added AFTER INSERT ON incidents BEGIN
  INSERT INTO incidents_text(rowid, tags, words) VALUES (new.seq, new.tags, new.words); END;
CREATE TRIGGER incidents_gone AFTER DELETE ON incidents BEGIN
  INSERT INTO incidents_text(incidents_text, rowid, tags, words)
  VALUES ('delete', old.seq, old.tags, old.words); END;
CREATE TRIGGER incidents_changed AFTER UPDATE OF tags, words ON incidents BEGIN
  INSERT INTO incidents_text(incidents_text, rowid, tags, words)
  VALUES ('delete', old.seq, old.tags, old.words);
  INSERT INTO incidents_text(rowid, tags, words) VALUES (new.seq, new.tags, new.words); END;
"""


def beside(path: Path) -> Path:
    """Where this version keeps its incidents when the file at `path` is a later version's."""
    return path.with_name(f"{path.stem}.v{VERSION}{path.suffix}")


def database_path(state_dir: Path) -> tuple[Path, int]:
    """The file that this version uses in a folder, and the version of a later one that it leaves alone (0: none).

    Raises:
        StoreError: the file is there and cannot be read.
    """
    path = state_dir / NAME
    version = _version(path)
    return (beside(path), version) if version > VERSION else (path, 0)


def open_for_reading(path: Path, *, any_version: bool = False) -> sqlite3.Connection:
    """A connection that writes nothing; works beside a program that writes, and on a disk that takes nothing.

    Args:
        path: of the database.
        any_version: an older version will do.

    Raises:
        StoreError: there is no such file, or it is no database of incidents.
    """
    if not path.exists():
        raise StoreError(path, "there is none; the patrol makes it when it starts")
    wal = path.with_name(path.name + "-wal")
    with errors_of(path):
        try:
            connection = _connect(path, "mode=ro")
            connection.execute("SELECT n FROM links LIMIT 1").fetchone()
        except sqlite3.OperationalError:
            if wal.exists() and wal.stat().st_size:
                raise
            connection = _connect(path, "immutable=1")
            connection.execute("SELECT n FROM links LIMIT 1").fetchone()
    version = VERSION if any_version else connection.execute("PRAGMA user_version").fetchone()[0]
    if version < VERSION:
        connection.close()
        raise StoreError(path, f"is of version {version}; the patrol makes a new one of it when it starts")
    return connection


def open_for_writing(path: Path) -> sqlite3.Connection:
    """A connection that writes; makes the database if there is none.

    Raises:
        StoreError: `is_corrupt` where the file is no such database or a damaged one.
    """
    with errors_of(path), ExitStack() as undo:
        path.parent.mkdir(parents=True, exist_ok=True)
        connection = _connect(path, "mode=rwc")
        undo.callback(connection.close)
        _prepare(connection, path)
        undo.pop_all()
    return connection


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    uri = f"{path.absolute().as_uri()}?{mode}"
    connection = sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
    connection.row_factory = sqlite3.Row
    return connection


def _prepare(connection: sqlite3.Connection, path: Path) -> None:
    if not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA synchronous=FULL")
    connection.execute("PRAGMA journal_size_limit=4194304")
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version == 0 and not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        connection.executescript(
            f"BEGIN IMMEDIATE;{_SCHEMA}PRAGMA application_id={APPLICATION_ID};PRAGMA user_version={VERSION};COMMIT;"
        )
        return
    if connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID or version > VERSION:
        raise StoreError(path, "is a database, but not one of incidents", is_corrupt=True)
    if version < VERSION:
        raise StoreError(path, f"is of version {version}, this program knows version {VERSION}", is_corrupt=True)
    problem = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    if problem != "ok":
        raise StoreError(path, f"is damaged: {problem.splitlines()[0]}", is_corrupt=True)


def _version(path: Path) -> int:
    """The version in a file's header; 0 if there is no file or no version."""
    if not path.exists():
        return 0
    try:
        with path.open("rb") as file:
            head = file.read(72)
    except OSError as err:
        raise StoreError(path, f"cannot be read: {err.strerror or err}") from err
    is_ours = head.startswith(b"SQLite format 3\0") and int.from_bytes(head[68:72], "big") == APPLICATION_ID
    return int.from_bytes(head[60:64], "big") if is_ours else 0


@contextmanager
def errors_of(path: Path) -> Iterator[None]:
    """Whatever SQLite and the disk say about a file, as a StoreError."""
    try:
        yield
    except sqlite3.Error as err:
        name = getattr(err, "sqlite_errorname", "") or ""
        is_corrupt = name.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB")) or (
            type(err) is sqlite3.DatabaseError and not name
        )
        raise StoreError(path, str(err), is_full=name.startswith("SQLITE_FULL"), is_corrupt=is_corrupt) from err
    except OSError as err:
        is_full = err.errno in DISK_FULL or err.errno == errno.EFBIG  # the file may not grow: less in it helps, too
        raise StoreError(path, f"{err.strerror or err}", is_full=is_full) from err


@contextmanager
def transaction(connection: sqlite3.Connection, path: Path) -> Iterator[sqlite3.Connection]:
    """All or nothing, on the disk when it ends. Raises StoreError."""
    with errors_of(path), connection:  # which commits, or rolls back
        connection.execute("BEGIN IMMEDIATE")
        yield connection


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
    """Insert a row for an open record, unless there is one of its id."""
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
    """A word of the text index for the room with the person, if another one had called."""
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
    """The text without characters that SQLite cannot hold."""
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "\ufffd")


def _without_lists(incident: Incident) -> dict[str, Any]:
    return incident_to_plain(replace(incident, events=(), files=()))


def _update(connection: sqlite3.Connection, incident: Incident, **more: Any) -> None:
    values = {**columns_of(incident), **more}
    changes = ", ".join(f"{name}=:{name}" for name in values)
    connection.execute(f"UPDATE incidents SET {changes} WHERE id=:id", values)
