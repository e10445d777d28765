"""The incidents of version 1.0, written with plain SQL as that version did (commit v1.0.0, version 2 of its tables)."""

import dataclasses
import json
import sqlite3

from rosbot_patrol.alerts.records import chain

SCHEMA = """
CREATE TABLE links (
  n INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, incident TEXT NOT NULL, wall REAL NOT NULL,
  body TEXT, digest TEXT NOT NULL, previous TEXT NOT NULL, hash TEXT NOT NULL);
CREATE INDEX links_incident ON links(incident);
CREATE TABLE incidents (
  seq INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, wall REAL NOT NULL, room_id INTEGER NOT NULL,
  room_name TEXT NOT NULL, origin TEXT NOT NULL, verdict TEXT NOT NULL, reason TEXT NOT NULL, share REAL,
  object_class TEXT NOT NULL, closed REAL, link INTEGER, bytes INTEGER NOT NULL DEFAULT 0,
  tags TEXT NOT NULL, words TEXT NOT NULL, record TEXT, late INTEGER NOT NULL DEFAULT 0);
CREATE TABLE events (
  n INTEGER PRIMARY KEY, incident TEXT NOT NULL, wall REAL NOT NULL, kind TEXT NOT NULL, text TEXT NOT NULL,
  data TEXT NOT NULL);
CREATE TABLE files (
  incident TEXT NOT NULL, name TEXT NOT NULL, role TEXT NOT NULL, sha256 TEXT NOT NULL, size INTEGER NOT NULL,
  stamp REAL, caption TEXT NOT NULL, PRIMARY KEY (incident, name));
CREATE VIRTUAL TABLE incidents_text USING fts5(
  tags, words, content='incidents', content_rowid='seq', tokenize='unicode61 remove_diacritics 2', prefix='2 3');
"""


class Database:
    """The database of a folder; `close` leaves no WAL."""

    def __init__(self, folder, version=2):
        self.path = folder / "incidents.sqlite"
        self.root = folder / "incidents"
        self.sql = sqlite3.connect(self.path, isolation_level=None)
        self.sql.execute("PRAGMA auto_vacuum=INCREMENTAL")
        self.sql.execute("PRAGMA journal_mode=WAL")
        self.sql.executescript(f"{SCHEMA}PRAGMA application_id={0x52504149};PRAGMA user_version={version};")
        self._head = (0, chain.START)
        self._append(chain.BEGUN, "", 1.0, {"wall": 1.0})

    def closed(self, incident, *pictures):
        """A closed record with its pictures."""
        self._pictures(incident, pictures)
        n = self._append(chain.RECORD, incident.id, incident.closed, dataclasses.asdict(incident))
        self._row(incident, link=n, record=None)

    def open(self, incident, *pictures):
        """A record of a mission that runs: events and files stand in their own tables."""
        self._pictures(incident, pictures)
        bare = dataclasses.asdict(dataclasses.replace(incident, events=(), files=()))
        self._row(incident, link=None, record=chain.canonical(bare))
        for event in incident.events:
            values = (incident.id, event.wall, event.kind, event.text, json.dumps(dict(event.data)))
            self.sql.execute("INSERT INTO events (incident, wall, kind, text, data) VALUES (?, ?, ?, ?, ?)", values)
        for file in incident.files:
            values = (incident.id, file.name, file.role, file.sha256, file.size, file.stamp, file.caption)
            self.sql.execute("INSERT INTO files VALUES (?, ?, ?, ?, ?, ?, ?)", values)

    def amend(self, incident_id, text):
        """An amendment to a closed record."""
        self._append(chain.AMENDMENT, incident_id, 70.0, {"text": text, "data": {"by": "owner"}})

    def remove(self, incident_id):
        """A removal by retention."""
        self._append(chain.REMOVAL, incident_id, 80.0, {"why": "age", "verdict": "clear", "wall": 1.0})
        self.sql.execute("UPDATE links SET body=NULL WHERE incident=? AND kind != 'removal'", (incident_id,))
        self.sql.execute("DELETE FROM incidents WHERE id=?", (incident_id,))

    def links(self):
        """All links as they stand there."""
        rows = self.sql.execute("SELECT n, kind, incident, wall, body, digest, previous, hash FROM links ORDER BY n")
        names = ("n", "kind", "incident", "wall", "body", "digest", "previous", "hash")
        return [chain.Link(**dict(zip(names, row, strict=True))) for row in rows]

    def close(self):
        self.sql.close()

    def _append(self, kind, incident_id, wall, tree):
        link = chain.make_link(self._head, kind, incident_id, wall, chain.canonical(tree))
        self._head = (link.n, link.hash)
        self.sql.execute(
            "INSERT INTO links VALUES (:n, :kind, :incident, :wall, :body, :digest, :previous, :hash)", vars(link)
        )
        return link.n

    def _row(self, incident, link, record):
        values = {name: getattr(incident, name) for name in ("id", "wall", "room_id", "room_name", "origin", "verdict")}
        values |= {name: getattr(incident, name) for name in ("reason", "object_class", "closed")}
        values |= {"link": link, "record": record, "tags": "", "words": ""}
        marks = ", ".join(f":{name}" for name in values)
        self.sql.execute(f"INSERT INTO incidents ({', '.join(values)}) VALUES ({marks})", values)

    def _pictures(self, incident, pictures):
        for name, data in pictures:
            (self.root / incident.id).mkdir(parents=True, exist_ok=True)
            (self.root / incident.id / name).write_bytes(data)
