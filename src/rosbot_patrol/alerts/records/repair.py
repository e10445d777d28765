"""Repair at the start: what a crash left between database and folders.

- A picture that no row names, in the folder of an open record: it is taken into the record.
- A picture of an open record that is not there: the record says so.
- A folder of a removed record: it goes.
- Any other folder without a record is left alone (of a database that was set aside, or of a later version).
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.database import (
    errors_of,
    insert_event,
    insert_file,
    transaction,
)
from rosbot_patrol.alerts.records.files import REPORT
from rosbot_patrol.alerts.records.incident import Event, StoredFile
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.counts import count_of


def repair(store: IncidentStore, *, wall: float) -> list[str]:
    """Repair what can be repaired; returns what was done, in sentences.

    Args:
        store: just opened, for writing.
        wall: now, seconds since 1970.

    Raises:
        StoreError: the disk does not take it.
    """
    said: list[str] = []
    for incident_id in store.open_ids():
        said += _complete(store, incident_id, wall)
    strays = _strays(store)
    removed = _removed(store)
    for incident_id in sorted(strays & removed):
        store.folder.remove(incident_id)
        said.append(f"incident {incident_id} had been removed; its files are gone now, too")
    unknown = strays - removed
    if unknown and not store.later_version:
        root = store.folder.root
        one, many = f"folder in {root} has no record here and is", f"folders in {root} have no record here and are"
        said.append(f"{count_of(len(unknown), one, many)} left alone")
    return said


def close_abandoned(store: IncidentStore, running: Collection[str], *, wall: float) -> list[str]:
    """Close records of missions that no longer run: the program ended, and nobody goes on with them.

    Args:
        store: of the incidents.
        running: ids of the missions that go on; further persons of one have "-2" and so on behind.
        wall: now, seconds since 1970.

    Returns:
        What was done, in sentences.
    """
    said = []
    for incident_id in store.open_ids():
        if any(incident_id == mission or incident_id.startswith(mission + "-") for mission in running):
            continue
        kept = store.get(incident_id)
        reason = (kept.reason if kept else "") or "the program ended before there was a verdict"
        verdict = (kept.verdict if kept else "") or "unverified"
        store.record(
            incident_id, add=[Event(wall=wall, kind="note", text="closed after a restart: the mission is over")]
        )
        store.close(incident_id, wall=wall, verdict=verdict, reason=reason)
        said.append(f"incident {incident_id} was still open and is closed now, {verdict}: {reason}")
    return said


def _complete(store: IncidentStore, incident_id: str, wall: float) -> list[str]:
    kept = store.get(incident_id)
    if kept is None:
        return []
    known = {file.name for file in kept.files}
    there = set(store.folder.names(incident_id)) - {REPORT}
    found, lost = sorted(there - known), sorted(known - there)
    if not found and not lost:
        return []
    texts = [f"the file {name} was found after a crash" for name in found]
    texts += [f"the file {name} was lost in a crash" for name in lost]
    files = [_stored(store, incident_id, name) for name in found]
    with transaction(store.connection, store.path):
        for file in files:
            insert_file(store.connection, incident_id, file)
        for name in lost:
            store.connection.execute("DELETE FROM files WHERE incident=? AND name=?", (incident_id, name))
        for text in texts:
            insert_event(store.connection, incident_id, Event(wall=wall, kind="note", text=text))
    return [f"incident {incident_id}: {text}" for text in texts]


def _stored(store: IncidentStore, incident_id: str, name: str) -> StoredFile:
    data = store.folder.read(incident_id, name)
    digest = hashlib.sha256(data).hexdigest()
    return StoredFile(name=name, role="other", sha256=digest, size=len(data), caption="found after a crash")


def _strays(store: IncidentStore) -> set[str]:
    with errors_of(store.path):
        known = {row["id"] for row in store.connection.execute("SELECT id FROM incidents")}
    return store.folder.ids() - known


def _removed(store: IncidentStore) -> set[str]:
    with errors_of(store.path):
        rows = store.connection.execute("SELECT incident FROM links WHERE kind=?", (chain.REMOVAL,))
        return {row["incident"] for row in rows}
