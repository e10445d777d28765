"""Incidents on disk: a database and a folder each. What a call wrote is on the disk when it returns.

A file is written before the row that names it, and a record is closed after both: a crash between leaves a file that
no row names, which `rosbot_patrol.alerts.records.repair` takes into the record. A removal is written to the chain
before the files go: a crash between leaves files of a removed record, which go at the next start.

One process writes records (the patrol); others may read, and prune. Not for several threads at once.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.database import (
    BUSY_TIMEOUT,
    FOLDER,
    WORDS,
    append_link,
    close_incident,
    database_path,
    errors_of,
    head_of,
    insert_event,
    insert_file,
    insert_incident,
    open_for_reading,
    open_for_writing,
    record_from_json,
    transaction,
    update_incident,
)
from rosbot_patrol.alerts.records.files import IncidentFolder, NewFile
from rosbot_patrol.alerts.records.incident import Event, Incident, StoredFile, is_name
from rosbot_patrol.errors import StoreError


class IncidentStore:
    """The incidents of a folder.

    Args:
        state_dir: holds the database and the incidents' folders.
        wall: now, seconds since 1970, for the chain of a new database.
        read_only: nothing is written, and nothing made.

    Raises:
        StoreError: the database cannot be used; `is_corrupt` where another begin at it would not help either (see
            rosbot_patrol.alerts.records.salvage).
    """

    def __init__(self, state_dir: Path, *, wall: float = 0.0, read_only: bool = False) -> None:
        self.state_dir = state_dir
        self.path, self.later_version = database_path(state_dir)
        self.folder = IncidentFolder(state_dir / FOLDER)
        self.connection = (open_for_reading if read_only else open_for_writing)(self.path)
        self._is_settled = read_only  # a kill may have left something in the WAL
        if not read_only and self.head() == (0, chain.START):
            with transaction(self.connection, self.path):
                append_link(self.connection, chain.BEGUN, "", wall, {"wall": wall})
            self.settle()

    def __enter__(self) -> IncidentStore:
        return self

    def __exit__(self, *_of: object) -> None:
        self.close_database()

    def close_database(self) -> None:
        """Let go of the file."""
        with suppress(StoreError):  # the last one that closes it does the same
            self.settle()
        self.connection.close()

    def settle(self) -> bool:
        """Move finished records from the WAL into the database, so that the loss of a WAL does not lose them.

        Returns:
            Whether that is done; somebody who reads for long holds it up.

        Raises:
            StoreError: the disk does not take it.
        """
        if not self._is_settled:
            with errors_of(self.path):
                self.connection.execute("PRAGMA busy_timeout=0")  # do not wait for readers
                try:
                    self._is_settled = not self.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]
                finally:
                    self.connection.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT * 1000:.0f}")
        return self._is_settled

    # -- a record while its mission runs

    def begin(self, incident: Incident) -> None:
        """Open a record, unless the id is known already. Raises StoreError, or ValueError for a bad id."""
        if not is_name(incident.id):
            raise ValueError(f"{incident.id!r} is no id for an incident")
        with transaction(self.connection, self.path):
            insert_incident(self.connection, replace(incident, closed=None, events=(), files=()))
            for event in incident.events:
                insert_event(self.connection, incident.id, event)
        self._is_settled = False

    def record(self, incident_id: str, *, add: Iterable[Event] = (), **changes: Any) -> None:
        """Add to an open record, all or nothing. Raises StoreError, also if it is not open.

        Args:
            incident_id: of the record.
            add: events.
            changes: fields with a new value, such as `times`.
        """
        with transaction(self.connection, self.path):
            incident = self._open(incident_id)
            if changes:
                update_incident(self.connection, replace(incident, **changes))
            for event in add:
                insert_event(self.connection, incident_id, event)

    def add_files(self, incident_id: str, files: Iterable[NewFile]) -> None:
        """Keep files of an open record; a name that is known gets the new content. Raises StoreError, ValueError."""
        files = list(files)
        self._open(incident_id)
        self.folder.write(incident_id, files)
        with transaction(self.connection, self.path):
            self._open(incident_id)
            for file in files:
                insert_file(self.connection, incident_id, file.stored())

    def close(self, incident_id: str, *, wall: float, **changes: Any) -> Incident:
        """Complete a record: from here on it is in the chain, and never changed again.

        Args:
            incident_id: of an open record; a closed one stays as it is.
            wall: now, seconds since 1970.
            changes: last fields, such as `verdict`.

        Returns:
            The record as it is kept.

        Raises:
            StoreError: the disk does not take it, or there is no such record.
        """
        kept = self.get(incident_id)
        if kept is None:
            raise StoreError(self.path, f"there is no incident '{incident_id}'")
        if kept.closed is not None:
            return kept
        incident = replace(kept, **changes, closed=wall)
        with transaction(self.connection, self.path):
            close_incident(self.connection, incident, wall)
        self._is_settled = False
        self.settle()
        return incident

    # -- afterwards

    def amend(self, incident_id: str, *, wall: float, text: str, data: Mapping[str, Any] | None = None) -> None:
        """Add something to a closed record: to the chain, as the record itself stays. Raises StoreError."""
        with transaction(self.connection, self.path):
            row = self._row(incident_id)
            if row is None or row["closed"] is None:
                raise StoreError(self.path, f"there is no closed incident '{incident_id}' to add to")
            body = {"text": text, "data": dict(data or {})}
            append_link(self.connection, chain.AMENDMENT, incident_id, wall, body)
            words = f"{row['words']} {text}"[:WORDS]
            self.connection.execute("UPDATE incidents SET words=? WHERE id=?", (words, incident_id))
        self._is_settled = False
        self.settle()

    def remove(self, incident_id: str, *, wall: float, why: str) -> None:
        """Forget a closed record and its files; its digest stays in the chain. Raises StoreError."""
        with transaction(self.connection, self.path):
            row = self._row(incident_id)
            if row is None or row["closed"] is None:
                raise StoreError(self.path, f"there is no closed incident '{incident_id}' to remove")
            body = {"why": why, "verdict": row["verdict"], "wall": row["wall"]}
            append_link(self.connection, chain.REMOVAL, incident_id, wall, body)
            self.connection.execute(
                "UPDATE links SET body=NULL WHERE incident=? AND kind IN (?, ?)",
                (incident_id, chain.RECORD, chain.AMENDMENT),
            )
            self.connection.execute("DELETE FROM incidents WHERE id=?", (incident_id,))
        self._is_settled = False  # `settle` after the last one
        self.folder.remove(incident_id)
        with errors_of(self.path):
            self.connection.execute("PRAGMA incremental_vacuum(64)").fetchall()

    # -- reading

    def get(self, incident_id: str) -> Incident | None:
        """A record, open or closed; None if there is none. Raises StoreError."""
        with errors_of(self.path):
            row = self._row(incident_id)
            if row is None:
                return None
            if row["closed"] is not None:
                body = self.connection.execute("SELECT body FROM links WHERE n=?", (row["link"],)).fetchone()
                return record_from_json(self.path, incident_id, body["body"] if body else None)
            incident = record_from_json(self.path, incident_id, row["record"])
            return replace(incident, events=self._events(incident_id), files=self._files(incident_id))

    def amendments(self, incident_id: str) -> tuple[Event, ...]:
        """What was added to a closed record. Raises StoreError."""
        with errors_of(self.path):
            rows = self.connection.execute(
                "SELECT wall, body FROM links WHERE incident=? AND kind=? AND body IS NOT NULL ORDER BY n",
                (incident_id, chain.AMENDMENT),
            ).fetchall()
        bodies = [(row["wall"], json.loads(row["body"])) for row in rows]
        return tuple(Event(wall=wall, kind="note", text=b["text"], data=b["data"]) for wall, b in bodies)

    def link(self, incident_id: str) -> chain.Link | None:
        """The link of a closed record. Raises StoreError."""
        with errors_of(self.path):
            row = self.connection.execute(
                "SELECT * FROM links WHERE incident=? AND kind=? ORDER BY n LIMIT 1", (incident_id, chain.RECORD)
            ).fetchone()
        return chain.Link(**dict(row)) if row else None

    def open_ids(self) -> tuple[str, ...]:
        """The records that are not closed, the oldest first. Raises StoreError."""
        with errors_of(self.path):
            rows = self.connection.execute("SELECT id FROM incidents WHERE closed IS NULL ORDER BY seq").fetchall()
        return tuple(row["id"] for row in rows)

    def head(self) -> tuple[int, str]:
        """Number and hash of the chain's last link; (0, START) before the first. Raises StoreError."""
        with errors_of(self.path):
            return head_of(self.connection)

    # -- rows

    def _row(self, incident_id: str) -> sqlite3.Row | None:
        row: sqlite3.Row | None = self.connection.execute(
            "SELECT * FROM incidents WHERE id=?", (incident_id,)
        ).fetchone()
        return row

    def _open(self, incident_id: str) -> Incident:
        with errors_of(self.path):
            row = self._row(incident_id)
        if row is None or row["closed"] is not None:
            state = "is closed" if row else "is not there"
            raise StoreError(self.path, f"the incident '{incident_id}' {state}, so that nothing can be added to it")
        return record_from_json(self.path, incident_id, row["record"])

    def _events(self, incident_id: str) -> tuple[Event, ...]:
        rows = self.connection.execute("SELECT * FROM events WHERE incident=? ORDER BY n", (incident_id,))
        return tuple(
            Event(wall=row["wall"], kind=row["kind"], text=row["text"], data=json.loads(row["data"])) for row in rows
        )

    def _files(self, incident_id: str) -> tuple[StoredFile, ...]:
        rows = self.connection.execute("SELECT * FROM files WHERE incident=? ORDER BY rowid", (incident_id,))
        return tuple(StoredFile(**{key: row[key] for key in row.keys() if key != "incident"}) for row in rows)  # noqa: SIM118


def recall_incident(state_dir: Path, incident_id: str) -> Incident | None:
    """A record, read beside a program that writes; None if there is none or it cannot be read."""
    try:
        with IncidentStore(state_dir, read_only=True) as store:
            return store.get(incident_id)
    except StoreError:
        return None
