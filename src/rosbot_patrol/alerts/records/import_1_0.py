"""Take over the incidents of version 1.0, which kept all of them in one SQLite file, `incidents.sqlite`.

Its records become files, and its links the chain, with the very same texts, digests and hashes. The database is renamed
afterwards, and never deleted. The chain is written last: a start that was killed before takes everything over again.

A damaged database, one of a version before 1.0, and one that appears beside a chain (1.0 had run again) give their
records only, which get new links. What is no such database is set aside.
"""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from pathlib import Path

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import format_line
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.files import (
    CHAIN,
    FOLDER,
    RECORD,
    IncidentFolder,
    amendment_name,
    free_name,
    time_stamp,
)
from rosbot_patrol.alerts.records.incident import (
    Event,
    Incident,
    StoredFile,
    incident_from_plain,
    incident_to_plain,
    is_name,
)
from rosbot_patrol.alerts.records.store import OLD_DATABASE, IncidentStore, has_incidents
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import sync_folder, write_atomic

_VERSION = 2  # of the database of 1.0
_APPLICATION_ID = 0x52504149  # "RPAI"
_ENDINGS = ("", "-wal", "-shm")
_GIVE_UP = 20_000  # rows in a row that cannot be read
_FOLDER_BYTES = 8192  # on the disk, for each record: its folder and the end of its last block
_WITH_FILES = (chain.RECORD, chain.AMENDMENT)  # kinds of links with a body in the incident's folder
_NONSENSE = (ValueError, TypeError, KeyError, AttributeError, RecursionError)


def take_over_whole(state_dir: Path) -> list[str]:
    """Make files and chain of a sound database, where there is no chain yet; returns what was done, in sentences.

    Raises:
        StoreError: the disk does not take it.
    """
    path = state_dir / OLD_DATABASE
    if not path.exists() or has_incidents(state_dir) or _later_version(path):
        return []
    try:
        with closing(_open(path)) as old, errors_of(path):
            old.execute("BEGIN")
            count = _write_files(old, state_dir)
    except StoreError as err:
        if not err.is_corrupt:
            raise
        return []  # `take_over_records` does what can be done
    aside = _rename(path, "imported")
    return [f"{path} is of version 1.0; {_were(count)} taken over as files, and it was renamed to {aside}"]


def take_over_records(store: IncidentStore, *, wall: float) -> list[str]:
    """Take the records of any other database, as far as they can be read; returns what was done, in sentences.

    Args:
        store: just opened, for writing.
        wall: now, seconds since 1970.

    Raises:
        StoreError: the disk does not take it.
    """
    path = store.state_dir / OLD_DATABASE
    if not path.exists():
        return []
    later = _later_version(path)
    if later:
        return [f"{path} is of version {later}, made by a later version of this program; it is left as it is"]
    if _is_taken_over(path, store):
        return [f"{path} had been taken over; it was renamed to {_rename(path, 'imported')}"]
    problem = _problem(path)
    count = _copy_records(path, store, wall)
    aside = _rename(path, f"broken-{time_stamp(wall)}" if problem else "imported")
    why = problem or "lay beside the incidents of this version"
    return [f"{path} {why}; it was set aside as {aside}, and {count_of(count, 'incident')} copied that could be read"]


def _were(count: int) -> str:
    return f"its {count_of(count, 'incident was', 'incidents were')}"


def _later_version(path: Path) -> int:
    """The version in a database's header, if it is later than 1.0's; else 0. Raises StoreError."""
    with errors_of(path), path.open("rb") as file:
        head = file.read(72)
    is_ours = head.startswith(b"SQLite format 3\0") and int.from_bytes(head[68:72], "big") == _APPLICATION_ID
    version = int.from_bytes(head[60:64], "big") if is_ours else 0
    return version if version > _VERSION else 0


def _open(path: Path, *, is_checked: bool = True) -> sqlite3.Connection:
    """A connection that writes nothing. Raises StoreError, `is_corrupt` for any but a sound database of 1.0."""
    with errors_of(path):
        uri = f"{path.absolute().as_uri()}?mode=ro"
        with ExitStack() as undo:
            old = sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)
            undo.callback(old.close)
            old.row_factory = sqlite3.Row
            if is_checked:
                _check(old, path)
            undo.pop_all()
    return old


def _check(old: sqlite3.Connection, path: Path) -> None:
    found = {name: old.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")}
    if found["application_id"] != _APPLICATION_ID:
        raise StoreError(path, "is not a database of incidents", is_corrupt=True)
    if found["user_version"] != _VERSION:
        raise StoreError(path, f"is of version {found['user_version']}, before 1.0", is_corrupt=True)
    problem = old.execute("PRAGMA quick_check(1)").fetchone()[0]
    if problem != "ok":
        raise StoreError(path, f"is damaged: {problem.splitlines()[0]}", is_corrupt=True)


def _problem(path: Path) -> str:
    """What is wrong with a database; "" if it is a sound one of 1.0."""
    try:
        _open(path).close()
    except StoreError as err:
        return err.problem
    return ""


# -- a sound database


def _write_files(old: sqlite3.Connection, state_dir: Path) -> int:
    """Write records, amendments and chain; returns the number of records. Raises OSError, StoreError, sqlite3.Error."""
    folder = IncidentFolder(state_dir / FOLDER)
    _check_room(old, state_dir)
    count = 0
    for row in old.execute("SELECT * FROM links WHERE body IS NOT NULL AND kind IN (?, ?)", _WITH_FILES):
        name = RECORD if row["kind"] == chain.RECORD else amendment_name(row["n"])
        _write(folder, row["incident"], name, row["body"])
        count += row["kind"] == chain.RECORD
    for incident in _open_records(old):
        _write(folder, incident.id, RECORD, chain.canonical(incident_to_plain(incident)))
        count += 1
    os.sync()  # one for all: a hundred thousand files take minutes otherwise
    rows = old.execute("SELECT * FROM links ORDER BY n")
    write_atomic(folder.root / CHAIN, b"".join(format_line(chain.Link(**dict(row))) for row in rows))
    return count


def _write(folder: IncidentFolder, incident_id: str, name: str, text: str) -> None:
    if not is_name(incident_id):
        raise StoreError(folder.root, f"{incident_id!r} is no id of an incident", is_corrupt=True)
    path = folder.path(incident_id, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode("utf-8"))


def _check_room(old: sqlite3.Connection, state_dir: Path) -> None:
    count, size = old.execute("SELECT count(*), total(length(CAST(body AS BLOB))) FROM links").fetchone()
    wanted = int(size) + count * _FOLDER_BYTES
    free = shutil.disk_usage(state_dir).free
    if free < wanted:
        text = f"its incidents need {wanted / 1e6:.0f} MB as files, and {free / 1e6:.0f} MB are free on the disk"
        raise StoreError(state_dir / OLD_DATABASE, text, is_full=True)


# -- any other one


def _is_taken_over(path: Path, store: IncidentStore) -> bool:
    """Whether the chain has the database's last link: the start that took it over was killed before the end."""
    with suppress(StoreError, sqlite3.Error), closing(_open(path)) as old:
        row = old.execute("SELECT hash FROM links ORDER BY n DESC LIMIT 1").fetchone()
        hashes = (line.link.hash for line in store.chain.lines() if line.link is not None)
        return row is not None and row["hash"] in hashes
    return False


def _copy_records(path: Path, store: IncidentStore, wall: float) -> int:
    """Copy records that the store does not have, and link them; returns the number. Raises StoreError."""
    copied = 0
    with closing(_open(path, is_checked=False)) as old:
        if not _has_links(old):
            return 0
        for incident, text, notes in _closed_records(old):
            if store.get(incident.id) is None:
                with errors_of(store.folder.path(incident.id)):
                    _write(store.folder, incident.id, RECORD, text)
                    sync_folder(store.folder.path(incident.id))
            store.close(incident.id, wall=wall)
            known = {note.text for note in store.amendments(incident.id)}
            for note in notes:
                if note.text not in known:
                    store.amend(incident.id, wall=note.wall, text=note.text, data=note.data)
            copied += 1
        for incident in _open_records(old):
            if store.get(incident.id) is None:
                store.folder.write_record(incident)
            copied += 1
    return copied


def _has_links(old: sqlite3.Connection) -> bool:
    with suppress(sqlite3.Error):
        return bool(old.execute("SELECT count(*) FROM sqlite_master WHERE name='links'").fetchone()[0])
    return False


def _closed_records(old: sqlite3.Connection) -> Iterator[tuple[Incident, str, list[Event]]]:
    """Records that are whole, with their text and what was added to them."""
    notes: dict[str, list[Event]] = {}
    for row in _readable(old, "links", "n"):
        if row["kind"] == chain.AMENDMENT and _is_whole(row):
            with suppress(*_NONSENSE):
                body = json.loads(row["body"])
                note = Event(wall=row["wall"], kind="note", text=body["text"], data=body["data"])
                notes.setdefault(row["incident"], []).append(note)
    for row in _readable(old, "links", "n"):
        if row["kind"] == chain.RECORD and _is_whole(row):
            with suppress(*_NONSENSE):
                incident = incident_from_plain(json.loads(row["body"]))
                if incident.id == row["incident"] and is_name(incident.id) and incident.closed is not None:
                    yield incident, row["body"], notes.get(incident.id, [])


def _open_records(old: sqlite3.Connection) -> Iterator[Incident]:
    """Records of missions that ran, with their events and files from tables of their own."""
    events: dict[str, list[Event]] = {}
    files: dict[str, list[StoredFile]] = {}
    for row in _readable(old, "events", "n"):
        with suppress(*_NONSENSE):
            event = Event(wall=row["wall"], kind=row["kind"], text=row["text"], data=json.loads(row["data"]))
            events.setdefault(row["incident"], []).append(event)
    for row in _readable(old, "files", "rowid"):
        file = StoredFile(**{key: row[key] for key in ("name", "role", "sha256", "size", "stamp", "caption")})
        files.setdefault(row["incident"], []).append(file)
    for row in _readable(old, "incidents", "seq"):
        if row["closed"] is None and row["record"] and is_name(str(row["id"])):
            with suppress(*_NONSENSE):
                incident = incident_from_plain(json.loads(row["record"]))
                own_events, own_files = tuple(events.get(row["id"], ())), tuple(files.get(row["id"], ()))
                yield replace(incident, id=row["id"], events=own_events, files=own_files)


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


def _rename(path: Path, ending: str) -> str:
    """Rename a database with its WAL; returns the new name. Raises StoreError."""
    with errors_of(path):
        aside = free_name(path, ending)
        for more in reversed(_ENDINGS):  # the file itself last, so that a crash meanwhile begins again
            with suppress(FileNotFoundError):
                path.with_name(path.name + more).replace(aside.with_name(aside.name + more))
        sync_folder(path.parent)
    return aside.name
