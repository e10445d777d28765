"""Opening of the incidents in any state: a damaged database is set aside, and what can be read is copied."""

from __future__ import annotations

import json
import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.database import (
    append_link,
    close_incident,
    database_path,
    errors_of,
    insert_event,
    insert_file,
    insert_incident,
    open_for_reading,
    open_for_writing,
    transaction,
)
from rosbot_patrol.alerts.records.incident import Event, Incident, StoredFile, incident_from_plain
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import sync_folder

_GIVE_UP = 20_000  # rows in a row that cannot be read
_ENDINGS = ("-wal", "-shm")


def open_store(state_dir: Path, *, wall: float) -> tuple[IncidentStore, list[str]]:
    """The incidents of a folder, and what the owner has to know about it.

    A damaged database is renamed, a new one begun, and each record that is still whole copied. One of a later version
    stays as it is, a new one is begun beside it.

    Args:
        state_dir: holds database and folders.
        wall: now, seconds since 1970.

    Raises:
        StoreError: the folder cannot be used at all.
    """
    said = []
    try:
        store = IncidentStore(state_dir, wall=wall)
    except StoreError as err:
        if not err.is_corrupt:
            raise
        store, sentence = _begin_anew(state_dir, err, wall)
        said.append(sentence)
    if store.later_version:
        said.append(
            f"{state_dir / 'incidents.sqlite'} is of version {store.later_version}, made by a later version of this"
            f" program; it is left as it is, and incidents are kept in {store.path.name} beside it"
        )
    return store, said


def _begin_anew(state_dir: Path, problem: StoreError, wall: float) -> tuple[IncidentStore, str]:
    # The new one is whole before it takes the old one's place: a crash meanwhile begins all over again.
    path, _ = database_path(state_dir)
    aside = _free_name(path, wall)
    fresh = path.with_name(path.name + ".new")
    with errors_of(path):
        _unlink(fresh)
        copied = _copy(path, fresh, wall, {"wall": wall, "from": aside.name, "why": problem.problem})
        os.link(path, aside)
        for ending in _ENDINGS:
            with suppress(FileNotFoundError):
                path.with_name(path.name + ending).replace(aside.with_name(aside.name + ending))
        fresh.replace(path)
        sync_folder(state_dir)
    return IncidentStore(state_dir, wall=wall), (
        f"{path} {problem.problem}; it was set aside as {aside.name}, a new one begun,"
        f" and {count_of(copied, 'incident')} copied that could still be read"
    )


def _free_name(path: Path, wall: float) -> Path:
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall))
    names = (path.with_name(f"{path.name}.broken-{stamp}{more}") for more in ("", *(f"-{i}" for i in range(2, 1000))))
    return next(name for name in names if not name.exists())


def _unlink(path: Path) -> None:
    for ending in ("", *_ENDINGS):
        path.with_name(path.name + ending).unlink(missing_ok=True)


def _copy(path: Path, fresh: Path, wall: float, begun: dict[str, Any]) -> int:
    """Make a new database with every record of the old one that is whole; returns how many."""
    new = open_for_writing(fresh)
    try:
        with transaction(new, fresh):
            append_link(new, chain.BEGUN, "", wall, begun)
            copied = _copy_records(path, new, wall)
        new.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        return copied
    finally:
        new.close()


def _copy_records(path: Path, new: sqlite3.Connection, wall: float) -> int:
    try:
        old = open_for_reading(path, any_version=True)
    except StoreError:
        return 0  # not even its first page makes sense
    copied = 0
    try:
        for incident, added in _closed_records(old):
            insert_incident(new, incident)
            close_incident(new, incident, wall)
            for body in added:
                append_link(new, chain.AMENDMENT, incident.id, wall, body)
            copied += 1
        for incident in _open_records(old):
            insert_incident(new, replace(incident, events=(), files=()))
            for event in incident.events:
                insert_event(new, incident.id, event)
            for file in incident.files:
                insert_file(new, incident.id, file)
            copied += 1
    finally:
        old.close()
    return copied


def _closed_records(old: sqlite3.Connection) -> Iterator[tuple[Incident, list[dict[str, Any]]]]:
    added: dict[str, list[dict[str, Any]]] = {}
    for row in _readable(old, "links", "n"):
        if row["kind"] == chain.AMENDMENT and _is_whole(row):
            added.setdefault(row["incident"], []).append(json.loads(row["body"]))
    seen = set()
    for row in _readable(old, "links", "n"):
        if row["kind"] != chain.RECORD or not _is_whole(row) or row["incident"] in seen:
            continue
        with suppress(ValueError, TypeError, KeyError, AttributeError):
            incident = incident_from_plain(json.loads(row["body"]))
            seen.add(incident.id)
            yield incident, added.get(incident.id, [])


def _open_records(old: sqlite3.Connection) -> Iterator[Incident]:
    events: dict[str, list[Event]] = {}
    files: dict[str, list[StoredFile]] = {}
    for row in _readable(old, "events", "n"):
        with suppress(ValueError, TypeError):
            event = Event(wall=row["wall"], kind=row["kind"], text=row["text"], data=json.loads(row["data"]))
            events.setdefault(row["incident"], []).append(event)
    for row in _readable(old, "files", "rowid"):
        file = StoredFile(**{key: row[key] for key in ("name", "role", "sha256", "size", "stamp", "caption")})
        files.setdefault(row["incident"], []).append(file)
    for row in _readable(old, "incidents", "seq"):
        if row["closed"] is None and row["record"]:
            with suppress(ValueError, TypeError, KeyError, AttributeError):
                incident = incident_from_plain(json.loads(row["record"]))
                yield replace(
                    incident, events=tuple(events.get(incident.id, ())), files=tuple(files.get(incident.id, ()))
                )


def _is_whole(row: sqlite3.Row) -> bool:
    return isinstance(row["body"], str) and chain.digest(row["body"]) == row["digest"]


def _readable(old: sqlite3.Connection, table: str, key: str) -> Iterator[sqlite3.Row]:
    """The rows of a table in the order of its integer key, around those that cannot be read."""
    last = failures = 0
    while failures < _GIVE_UP:
        try:
            row = old.execute(f"SELECT {key} AS k_, * FROM {table} WHERE {key} > ? ORDER BY {key} LIMIT 1", (last,))
            found = row.fetchone()
        except sqlite3.Error:
            last += 1
            failures += 1
            continue
        if found is None:
            return
        last, failures = found["k_"], 0
        yield found
