"""Incidents on disk: a folder each, a chain, and an index. What a call wrote is on the disk when it returns.

The files are the truth. While a mission runs, `incidents/ID/record.json` is replaced whole by each call. A picture is
written before the record that names it. On closing, the record is written first, then its link in `chain.jsonl`. A
removal is written to the chain before the files go. `rosbot_patrol.alerts.records.repair` mends what a crash left in
between.

The index comes last. If it cannot be written, the call still succeeds, as the files hold everything. The next call then
brings the index up to date; a start makes it anew if need be.

One process writes records (the patrol); others may read, and prune. Not for several threads at once.
"""

from __future__ import annotations

import json
import logging
import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import ChainFile
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.files import CHAIN, FOLDER, IncidentFolder, NewFile, amendment_name, is_own
from rosbot_patrol.alerts.records.incident import Event, Incident, is_name
from rosbot_patrol.alerts.records.index import NAME as INDEX
from rosbot_patrol.alerts.records.index import put_incident, transaction
from rosbot_patrol.alerts.records.indexing import Found, catch_up, open_for_reading, open_for_writing
from rosbot_patrol.errors import StoreError

log = logging.getLogger(__name__)

MAX_EVENTS = 2000  # of one record
OLD_DATABASE = "incidents.sqlite"  # of version 1.0, see rosbot_patrol.alerts.records.import_1_0


def has_incidents(state_dir: Path) -> bool:
    """Whether a folder holds incidents."""
    return (state_dir / FOLDER / CHAIN).is_file()


class IncidentStore:
    """The incidents of a folder.

    Args:
        state_dir: holds the folder with the incidents.
        wall: now, seconds since 1970, for a new chain.
        read_only: nothing is written, and nothing made.
        why: for a new chain: why the one before it ended, "" if there was none.

    Attributes:
        found: what opening found in the files.

    Raises:
        StoreError: the incidents cannot be used; `is_corrupt` if the chain holds no link that makes sense.
    """

    def __init__(self, state_dir: Path, *, wall: float = 0.0, read_only: bool = False, why: str = "") -> None:
        self.state_dir = state_dir
        self.folder = IncidentFolder(state_dir / FOLDER)
        self.chain = ChainFile(self.folder.root / CHAIN)
        self.path = self.folder.root / INDEX
        self.found = Found()
        self._unlisted: dict[str, tuple[Incident, int]] = {}  # open records that the index has to take yet
        self._is_behind = False
        self._connection: sqlite3.Connection | None = None
        if read_only:
            self._check()
        else:
            self._connection = self._open(wall, why)

    def _check(self) -> None:
        if self.chain.path.exists():
            return
        old = self.state_dir / OLD_DATABASE
        if old.exists():
            raise StoreError(old, "is of version 1.0; the patrol takes its incidents over when it starts")
        raise StoreError(self.chain.path, "there is none; the patrol makes it when it starts")

    def _open(self, wall: float, why: str) -> sqlite3.Connection:
        with errors_of(self.folder.root):
            self.folder.root.mkdir(parents=True, exist_ok=True)
        with self.chain.locked(is_made=True):
            cut = self.chain.cut_tail()
            if cut:
                self.found.said.append(
                    f"{self.chain.path} ended in {cut} bytes of a link that was cut off; they are gone"
                )
            if self.chain.head() == (0, chain.START):
                if self.chain.size:
                    raise StoreError(self.chain.path, "holds no link that makes sense", is_corrupt=True)
                body = {"wall": wall, "why": why} if why else {"wall": wall}
                self.chain.append(chain.BEGUN, "", wall, chain.canonical(body))
            return open_for_writing(self.folder, self.chain, self.found)

    def __enter__(self) -> IncidentStore:
        return self

    def __exit__(self, *_of: object) -> None:
        self.close_index()

    @property
    def connection(self) -> sqlite3.Connection:
        """The index. Raises StoreError."""
        if self._connection is None:
            self._connection = open_for_reading(self.folder, self.chain)
        return self._connection

    def close_index(self) -> None:
        """Let go of the index."""
        if self._connection is not None:
            with suppress(sqlite3.Error):
                self._connection.close()

    # -- a record while its mission runs

    def begin(self, incident: Incident) -> None:
        """Open a record, unless the id is known already. Raises StoreError, or ValueError for a bad id."""
        if not is_name(incident.id):
            raise ValueError(f"{incident.id!r} is no id for an incident")
        self._mend_index()
        if self.folder.text(incident.id) is None:
            events = _limited((), incident.events)
            self._write_open(replace(incident, closed=None, events=events, files=()))

    def record(self, incident_id: str, *, add: Iterable[Event] = (), **changes: Any) -> None:
        """Add to an open record, all or nothing. Raises StoreError, also if it is not open.

        Args:
            incident_id: of the record.
            add: events.
            changes: fields with a new value, such as `times`.
        """
        self._mend_index()
        kept = self._open_record(incident_id)
        self._write_open(replace(kept, **changes, events=_limited(kept.events, tuple(add))))

    def add_files(self, incident_id: str, files: Iterable[NewFile]) -> None:
        """Keep files of an open record; a name that is known gets the new content. Raises StoreError, ValueError."""
        files = list(files)
        for file in files:
            if is_own(file.name):
                raise ValueError(f"{file.name!r} is no name for a file of a record")
        self._mend_index()
        kept = self._open_record(incident_id)
        if not files:
            return
        known = {file.name: file for file in kept.files} | {file.name: file.stored() for file in files}
        self._write_open(replace(kept, files=tuple(known.values())), files)

    def rewrite(self, incident: Incident) -> None:
        """Replace an open record, after a crash. Raises StoreError."""
        self._open_record(incident.id)
        self._write_open(incident)

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
        with self.chain.locked():
            self._update_index()
            text = self.folder.text(incident_id)
            if text is None:
                raise StoreError(self.chain.path, f"there is no incident '{incident_id}'")
            kept = self.folder.parse(incident_id, text)
            if kept.closed is None:
                kept = replace(kept, **changes, closed=wall)
                text = self.folder.write_record(kept)
            elif self._is_linked(incident_id):
                return kept
            self.chain.append(chain.RECORD, incident_id, kept.closed or wall, text)
            self._follow()
        return kept

    # -- afterwards

    def amend(self, incident_id: str, *, wall: float, text: str, data: Mapping[str, Any] | None = None) -> None:
        """Add something to a closed record: to the chain, as the record itself stays. Raises StoreError."""
        with self.chain.locked():
            self._update_index()
            if not self._is_linked(incident_id):
                raise StoreError(self.chain.path, f"there is no closed incident '{incident_id}' to add to")
            body = chain.canonical({"text": text, "data": dict(data or {})})
            self.folder.write_amendment(incident_id, self.head()[0] + 1, body)
            self.chain.append(chain.AMENDMENT, incident_id, wall, body)
            self._follow()

    def remove(self, incident_id: str, *, wall: float, why: str) -> None:
        """Forget a closed record and its files; its digest stays in the chain. Raises StoreError."""
        with self.chain.locked():
            row = self._row(incident_id)  # on a full disk the index may be behind, and room is what is wanted
            if row is None or row["link"] is None:
                raise StoreError(self.chain.path, f"there is no closed incident '{incident_id}' to remove")
            body = {"why": why, "verdict": row["verdict"], "wall": row["wall"]}
            self.chain.append(chain.REMOVAL, incident_id, wall, chain.canonical(body))
            self._follow()
        self.folder.remove(incident_id)

    # -- reading

    def get(self, incident_id: str) -> Incident | None:
        """A record, open or closed; None if there is none. Raises StoreError."""
        return self.folder.record(incident_id) if is_name(incident_id) else None

    def amendments(self, incident_id: str) -> tuple[Event, ...]:
        """What was added to a closed record. Raises StoreError."""
        notes = []
        for link in self._links(incident_id, chain.AMENDMENT):
            body = self.folder.text(incident_id, amendment_name(link.n))
            if body is not None:
                path = self.folder.path(incident_id, amendment_name(link.n))
                notes.append(_note(path, link.wall, body))
        return tuple(notes)

    def link(self, incident_id: str) -> chain.Link | None:
        """The link of a closed record, with the record's text as its body. Raises StoreError."""
        links = self._links(incident_id, chain.RECORD)
        return replace(links[-1], body=self.folder.text(incident_id)) if links else None

    def open_ids(self) -> tuple[str, ...]:
        """The records that are not closed, the oldest first. Raises StoreError."""
        with errors_of(self.path):
            rows = self.connection.execute("SELECT id FROM incidents WHERE closed IS NULL ORDER BY seq").fetchall()
        return tuple(row["id"] for row in rows)

    def head(self) -> tuple[int, str]:
        """Number and hash of the chain's last link; (0, START) before the first. Raises StoreError."""
        return self.chain.head()

    # -- files and rows

    def _open_record(self, incident_id: str) -> Incident:
        kept = self.get(incident_id)
        if kept is None or kept.closed is not None:
            state = "is closed" if kept else "is not there"
            where = self.folder.root
            raise StoreError(where, f"the incident '{incident_id}' {state}, so that nothing can be added to it")
        return kept

    def _write_open(self, incident: Incident, files: Iterable[NewFile] = ()) -> None:
        text = self.folder.write_record(incident, files)
        self._unlisted[incident.id] = (incident, len(text))
        self._follow()

    def _follow(self) -> None:
        """Bring the index up to date; a failure is for the next call, as the files are written."""
        self._is_behind = True
        try:
            self._update_index()
        except StoreError as err:
            log.warning("the index of the incidents is behind: %s", err)

    def _mend_index(self) -> None:
        if self._is_behind:
            self._update_index()

    def _update_index(self) -> None:
        with transaction(self.connection, self.path):
            for incident, size in self._unlisted.values():
                put_incident(self.connection, incident, size)
            catch_up(self.connection, self.folder, self.chain, self.found)
        self._unlisted.clear()
        self._is_behind = False

    def _row(self, incident_id: str) -> sqlite3.Row | None:
        with errors_of(self.path):
            row: sqlite3.Row | None = self.connection.execute(
                "SELECT * FROM incidents WHERE id=?", (incident_id,)
            ).fetchone()
        return row

    def _is_linked(self, incident_id: str) -> bool:
        row = self._row(incident_id)
        return row is not None and row["link"] is not None

    def _links(self, incident_id: str, kind: str) -> list[chain.Link]:
        with errors_of(self.path):
            rows = self.connection.execute(
                "SELECT n, start, stop FROM links WHERE incident=? AND kind=? ORDER BY start", (incident_id, kind)
            ).fetchall()
        found = [(row["n"], self.chain.line(row["start"], row["stop"]).link) for row in rows]
        for n, link in found:
            if link is None or link.n != n:
                raise StoreError(self.chain.path, f"link {n} is not where it was; see 'incidents verify'")
        return [link for _, link in found if link is not None]


def recall_incident(state_dir: Path, incident_id: str) -> Incident | None:
    """A record, read beside a program that writes; None if there is none or it cannot be read."""
    try:
        with IncidentStore(state_dir, read_only=True) as store:
            return store.get(incident_id)
    except StoreError:
        return None


def _limited(kept: tuple[Event, ...], more: tuple[Event, ...]) -> tuple[Event, ...]:
    """The events of a record; the one after MAX_EVENTS says that there were more."""
    events = kept + more
    if len(kept) > MAX_EVENTS or len(events) <= MAX_EVENTS:
        return kept if len(kept) > MAX_EVENTS else events
    text = f"more than {MAX_EVENTS} events came; the others are not kept"
    return (*events[:MAX_EVENTS], Event(wall=events[MAX_EVENTS].wall, kind="note", text=text))


def _note(path: Path, wall: float, body: str) -> Event:
    try:
        tree = json.loads(body)
        return Event(wall=wall, kind="note", text=tree["text"], data=tree["data"])
    except (ValueError, TypeError, KeyError) as err:
        raise StoreError(path, f"makes no sense: {err!r}; see 'incidents verify'") from err
