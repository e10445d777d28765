"""Repair at the start: what a crash left between the files, the chain and the index.

- A closed record without a link: it gets its link.
- A picture that no record names, in the folder of an open record: it is taken into the record.
- A picture of an open record that is not there: the record says so.
- A record that cannot be read: it is set aside, under another name in its folder.
- A folder of a removed record: it goes.
- Any other folder without a record is left alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import replace

from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.incident import Event, StoredFile
from rosbot_patrol.alerts.records.index import transaction
from rosbot_patrol.alerts.records.indexing import put_open, removed_ids, strays
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
    said = _remove_leftovers(store)
    _list_open(store)
    said += _set_aside(store, wall)
    for incident_id in store.open_ids():
        said += _link(store, incident_id, wall) or _complete(store, incident_id, wall)
    with errors_of(store.path):
        unknown = len(strays(store.connection, store.folder))
    if unknown:
        root = store.folder.root
        one, many = f"folder in {root} has no record here and is", f"folders in {root} have no record here and are"
        said.append(f"{count_of(unknown, one, many)} left alone")
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


def _remove_leftovers(store: IncidentStore) -> list[str]:
    with errors_of(store.path):
        left = sorted(strays(store.connection, store.folder) & removed_ids(store.connection))
    for incident_id in left:
        store.folder.remove(incident_id)
    return [f"incident {incident_id} had been removed; its files are gone now, too" for incident_id in left]


def _list_open(store: IncidentStore) -> None:
    """Write the rows of open records again, as a power cut may have taken the last ones."""
    with transaction(store.connection, store.path):
        for incident_id in sorted(strays(store.connection, store.folder) | set(store.open_ids())):
            put_open(store.connection, store.folder, incident_id, store.found)


def _set_aside(store: IncidentStore, wall: float) -> list[str]:
    said = []
    for incident_id in sorted(store.found.damaged):
        name = store.folder.set_aside(incident_id, wall)
        with transaction(store.connection, store.path):
            store.connection.execute("DELETE FROM incidents WHERE id=?", (incident_id,))
        said.append(f"the record of incident {incident_id} makes no sense; it was set aside as {name}")
    store.found.damaged.clear()
    return said


def _link(store: IncidentStore, incident_id: str, wall: float) -> list[str]:
    kept = store.get(incident_id)
    if kept is None or kept.closed is None:
        return []
    store.close(incident_id, wall=wall)
    return [f"incident {incident_id} was closed without a link in the chain; it has one now"]


def _complete(store: IncidentStore, incident_id: str, wall: float) -> list[str]:
    kept = store.get(incident_id)
    if kept is None:
        return []
    known = {file.name for file in kept.files}
    there = set(store.folder.names(incident_id))
    found, lost = sorted(there - known), sorted(known - there)
    if not found and not lost:
        return []
    texts = [f"the file {name} was found after a crash" for name in found]
    texts += [f"the file {name} was lost in a crash" for name in lost]
    files = tuple(file for file in kept.files if file.name not in lost)
    files += tuple(_stored(store, incident_id, name) for name in found)
    events = tuple(Event(wall=wall, kind="note", text=text) for text in texts)
    store.rewrite(replace(kept, files=files, events=kept.events + events))
    return [f"incident {incident_id}: {text}" for text in texts]


def _stored(store: IncidentStore, incident_id: str, name: str) -> StoredFile:
    data = store.folder.read(incident_id, name)
    digest = hashlib.sha256(data).hexdigest()
    return StoredFile(name=name, role="other", sha256=digest, size=len(data), caption="found after a crash")
