"""The index of the incidents: an SQLite file for lists and searches, made of the files and made anew from them.

It holds nothing that the files do not hold, so that it may be removed at any time. WAL lets people read while the robot
writes. Tables:

- incidents: one row a record, open or closed, with what lists and searches need. `late` marks rows that began, by the
  clock, before one that was there already (the clock had jumped): all others are in the order of time, so that a search
  finds the rows of a time span without looking at each.
- incidents_text: an FTS5 index over two columns of incidents.
- links: where each link of the chain lies in its file.
- written: number of the last link that was ever indexed.

Functions that write rows are called within a transaction.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import Line
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.incident import Incident, Place
from rosbot_patrol.errors import StoreError

VERSION = 2
APPLICATION_ID = 0x52504958  # "RPIX"
NAME = "index.sqlite"
BUSY_TIMEOUT = 5.0  # [s] to wait for another writer
WORDS = 4000  # characters of a record that are searched
SCRATCH = "index.sqlite.new"  # while it is made

_ENDINGS = ("", "-wal", "-shm")

_SCHEMA = """
CREATE TABLE links (
  start INTEGER PRIMARY KEY, stop INTEGER NOT NULL, n INTEGER NOT NULL, kind TEXT NOT NULL, incident TEXT NOT NULL,
  hash TEXT NOT NULL);
CREATE INDEX links_incident ON links(incident);
CREATE TABLE written (n INTEGER NOT NULL);
INSERT INTO written VALUES (0);
CREATE TABLE incidents (
  seq INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, wall REAL NOT NULL, room_id INTEGER NOT NULL,
  room_name TEXT NOT NULL, origin TEXT NOT NULL, verdict TEXT NOT NULL, reason TEXT NOT NULL, share REAL,
  object_class TEXT NOT NULL, closed REAL, link INTEGER, bytes INTEGER NOT NULL, record_bytes INTEGER NOT NULL,
  tags TEXT NOT NULL, words TEXT NOT NULL, late INTEGER NOT NULL);
CREATE INDEX incidents_wall ON incidents(wall);
CREATE INDEX incidents_room ON incidents(room_id, wall);
CREATE INDEX incidents_verdict ON incidents(verdict, wall);
CREATE INDEX incidents_both ON incidents(room_id, verdict, wall);
CREATE INDEX incidents_open ON incidents(seq) WHERE closed IS NULL;
CREATE INDEX incidents_in_order ON incidents(wall) WHERE late = 0;
CREATE INDEX incidents_late ON incidents(wall) WHERE late = 1;
CREATE VIRTUAL TABLE incidents_text USING fts5(
  tags, words, content='incidents', content_rowid='seq', tokenize='unicode61 remove_diacritics 2', prefix='2 3');
CREATE TRIGGER incidents_added AFTER INSERT ON incidents BEGIN
  INSERT INTO incidents_text(rowid, tags, words) VALUES (new.seq, new.tags, new.words); END;
CREATE TRIGGER incidents_gone AFTER DELETE ON incidents BEGIN
  INSERT INTO incidents_text(incidents_text, rowid, tags, words)
  VALUES ('delete', old.seq, old.tags, old.words); END;
CREATE TRIGGER incidents_changed AFTER UPDATE OF tags, words ON incidents
WHEN old.tags != new.tags OR old.words != new.words BEGIN
  INSERT INTO incidents_text(incidents_text, rowid, tags, words)
  VALUES ('delete', old.seq, old.tags, old.words);
  INSERT INTO incidents_text(rowid, tags, words) VALUES (new.seq, new.tags, new.words); END;
"""


def make_index(path: Path) -> sqlite3.Connection:
    """An empty index in place of whatever lies there, to be filled in one go. Raises StoreError."""
    remove_index(path)
    with errors_of(path), ExitStack() as undo:
        connection = _connect(path, "mode=rwc")
        undo.callback(connection.close)
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL")
        connection.execute("PRAGMA journal_mode=MEMORY")
        _create(connection)
        undo.pop_all()
    return connection


def remove_index(path: Path) -> None:
    """Remove an index, if there is one. Raises StoreError."""
    with errors_of(path):
        for ending in _ENDINGS:
            path.with_name(path.name + ending).unlink(missing_ok=True)


def open_index(path: Path) -> sqlite3.Connection:
    """A connection that writes into the index that is there.

    Raises:
        StoreError: `is_corrupt` where it has to be made anew: missing, damaged, of another version or program.
    """
    with errors_of(path), ExitStack() as undo:
        if not path.exists():
            raise StoreError(path, "is missing", is_corrupt=True)
        connection = _connect(path, "mode=rw")
        undo.callback(connection.close)
        _check(connection, path)
        _tune(connection)
        problem = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        if problem != "ok":
            raise StoreError(path, f"is damaged: {problem.splitlines()[0]}", is_corrupt=True)
        undo.pop_all()
    return connection


def read_index(path: Path) -> sqlite3.Connection:
    """A connection that writes nothing; works beside a program that writes, and on a disk that takes nothing.

    Raises:
        StoreError: the index cannot be used.
    """
    wal = path.with_name(path.name + "-wal")
    modes = ["mode=ro"] if wal.exists() and wal.stat().st_size else ["mode=ro", "immutable=1"]
    while True:
        with errors_of(path), ExitStack() as undo:
            connection = _connect(path, modes.pop(0))
            undo.callback(connection.close)
            try:
                _check(connection, path)
            except sqlite3.OperationalError:
                if not modes:
                    raise
                continue
            undo.pop_all()
            return connection


def make_index_in_memory() -> sqlite3.Connection:
    """An empty index that is gone with its connection."""
    connection = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
    connection.row_factory = sqlite3.Row
    _create(connection)
    return connection


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    uri = f"{path.absolute().as_uri()}?{mode}"
    connection = sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
    connection.row_factory = sqlite3.Row
    return connection


def _tune(connection: sqlite3.Connection) -> None:
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA synchronous=NORMAL")  # a power cut may take the last rows: the files have them
    connection.execute("PRAGMA journal_size_limit=4194304")


def _create(connection: sqlite3.Connection) -> None:
    ids = f"PRAGMA application_id={APPLICATION_ID};PRAGMA user_version={VERSION};"
    connection.executescript(f"BEGIN IMMEDIATE;{_SCHEMA}{ids}COMMIT;")


def _check(connection: sqlite3.Connection, path: Path) -> None:
    found = tuple(connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
    if found != (APPLICATION_ID, VERSION):
        raise StoreError(path, "is not of this version", is_corrupt=True)
    connection.execute("SELECT n FROM links LIMIT 1").fetchone()


@contextmanager
def transaction(connection: sqlite3.Connection, path: Path) -> Iterator[sqlite3.Connection]:
    """All or nothing. Raises StoreError."""
    with errors_of(path), connection:  # which commits, or rolls back
        connection.execute("BEGIN IMMEDIATE")
        yield connection


def put_incident(connection: sqlite3.Connection, incident: Incident, size: int, link: int | None = None) -> None:
    """Write the row of an incident.

    Args:
        connection: of the index.
        incident: its record.
        size: of the record's text [characters].
        link: number of its link; None while the chain does not have it, then it counts as open.
    """
    values = columns_of(incident) | {"link": link, "record_bytes": size}
    if link is None:
        values["closed"] = None
    changes = ", ".join(f"{name}=:{name}" for name in values)
    if connection.execute(f"UPDATE incidents SET {changes} WHERE id=:id", values).rowcount:
        return
    newest = connection.execute("SELECT max(wall) FROM incidents").fetchone()[0]
    values["late"] = int(newest is not None and incident.wall < newest)
    marks = ", ".join(f":{name}" for name in values)
    connection.execute(f"INSERT INTO incidents ({', '.join(values)}) VALUES ({marks})", values)


def put_link(connection: sqlite3.Connection, line: Line, link: chain.Link) -> None:
    """Write where a link lies."""
    values = (line.start, line.stop, link.n, clean(link.kind), clean(link.incident), clean(link.hash))
    connection.execute("INSERT OR REPLACE INTO links VALUES (?, ?, ?, ?, ?, ?)", values)
    connection.execute("UPDATE written SET n=max(n, ?)", (link.n,))


def add_words(connection: sqlite3.Connection, incident_id: str, text: str) -> None:
    """Have an incident found by further words."""
    row = connection.execute("SELECT words FROM incidents WHERE id=?", (incident_id,)).fetchone()
    if row is not None:
        words = clean(f"{row['words']} {text}")[:WORDS]
        connection.execute("UPDATE incidents SET words=? WHERE id=?", (words, incident_id))


def last_line(connection: sqlite3.Connection) -> tuple[int, str, int, int]:
    """Number, hash, start and stop of the last link that the index knows; zeros before the first."""
    row = connection.execute("SELECT n, hash, start, stop FROM links ORDER BY start DESC LIMIT 1").fetchone()
    return tuple(row) if row else (0, chain.START, 0, 0)


def written_links(connection: sqlite3.Connection) -> int:
    """Number of the last link that was ever indexed."""
    return int(connection.execute("SELECT n FROM written").fetchone()[0])


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


def clean(text: str) -> str:
    """The text without characters that SQLite cannot hold."""
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "\ufffd")
