"""Keeper of the mission records, on a thread of its own: the patrol hands entries over and never waits.

Entries are written in order. Refused writes are retried, and reported in the log and on /diagnostics. On a full disk
the oldest clear incidents are removed first. A damaged index is made anew of the files.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import rospy

from rosbot_patrol.alerts.pictures.album import Album, Sighting
from rosbot_patrol.alerts.pictures.clip import CLIP, encode_clip
from rosbot_patrol.alerts.pictures.ring import EvidenceParams
from rosbot_patrol.alerts.records.files import REPORT, NewFile
from rosbot_patrol.alerts.records.incident import Event, Incident
from rosbot_patrol.alerts.records.opening import open_store
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.repair import close_abandoned, repair
from rosbot_patrol.alerts.records.retention import Pruned, RetentionParams, keep_reserve, make_room, prune
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.report.page import write_report
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import AlertError, StoreError
from rosbot_patrol.params import param
from rosbot_patrol.patrol.story.mission_log import Entry
from rosbot_patrol.ros.patrol.mission_map import MissionMap
from rosbot_patrol.ros.patrol.pictures import PictureRing
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

DISK_RETRY = 5.0  # time between attempts while the disk refuses something [s]
_BUSY, _IDLE = 0.5, 5.0  # time between checks for pictures, in a mission and without one [s]
_TIDY = 600.0  # time between checks of age and size [s]
_MOST = 5000  # entries in memory while the disk refuses writes; 2 kB each at most
_RECENT = 5  # number of latest records checked for a missing report
_SAME_AGAIN = 60.0  # time until the same problem is logged again [s]
_PATIENCE = 3.0  # longest wait for pictures after the end of a clip [s]


@dataclass(frozen=True, kw_only=True)
class RecordParams:
    """Parameters of the incidents' own reports on the disk."""

    report_verdicts: list[str] = param(
        ["confirmed", "unverified"],
        choices=("confirmed", "clear", "unreachable", "unverified"),
        doc="verdicts of incidents that get a report.html at once; `incidents report` makes one for any",
    )


@dataclass(kw_only=True)
class _Closing:
    """A finished mission. Its record waits for the last pictures, until `deadline` (monotonic) at most."""

    wall: float
    deadline: float
    files: list[NewFile] | None = None


class _Report:
    """Report of the keeper's health on /diagnostics and in the log."""

    def __init__(self, health: Health) -> None:
        self._health = health
        self._complaint = ("", 0.0)

    def works(self, done: Pruned | None = None) -> None:
        """Report that everything is written; `done` is what was removed meanwhile."""
        if done is None or not done.ids:
            self._health.set("incidents", OK, "incidents are kept")
            return
        is_of_disk = done.reason is not None and done.reason.is_of_disk
        self._health.set("incidents", WARN if is_of_disk else OK, done.sentence)

    def made_room(self, done: Pruned) -> None:
        """Report a full disk, with what was removed."""
        log.warning("incidents: %s", done.sentence)
        what = f"the disk is full: {count_of(len(done.ids), 'old incident was', 'old incidents were')} removed"
        self._health.set("incidents", WARN if done.ids else ERROR, what)

    def failed(self, err: StoreError) -> None:
        """Report that nothing can be written."""
        self._health.set("incidents", ERROR, f"incidents cannot be written: {err}")

    def no_clip(self, problem: str) -> None:
        """Report why the last clip was not made, "" if it was."""
        self._health.set("clips", WARN if problem else OK, problem or "clips are made")

    def complain(self, err: StoreError) -> None:
        """Log a problem; the same one at most once a minute."""
        text, at = self._complaint
        if str(err) == text and time.monotonic() - at < _SAME_AGAIN:
            return
        self._complaint = (str(err), time.monotonic())
        log.error("incidents cannot be written: %s; trying on every %.0f s", err, DISK_RETRY)


class IncidentKeeper:
    """Write entries and pictures into the incidents' store.

    Args:
        state_dir: folder that holds the folder of the incidents.
        pictures: the camera's last pictures.
        health: receives the keeper's health.
        evidence, retention, records: parameters.
        on_verdict: called on the keeper's thread when a mission is over and its verdict on the disk.
    """

    def __init__(
        self,
        state_dir: Path,
        pictures: PictureRing,
        health: Health,
        *,
        evidence: EvidenceParams | None = None,
        retention: RetentionParams | None = None,
        records: RecordParams | None = None,
        on_verdict: Callable[[Incident], None] = lambda _: None,
    ) -> None:
        self.state_dir = state_dir
        self._pictures, self._report, self._on_verdict = pictures, _Report(health), on_verdict
        self._evidence = evidence or EvidenceParams()
        self._retention, self._records = retention or RetentionParams(), records or RecordParams()
        self._album = Album(self._evidence)
        self._store: IncidentStore | None = None
        self._running: Collection[str] | None = None
        self._entries: deque[Entry | tuple[str, NewFile]] = deque()
        self._seen: deque[tuple[str, float]] = deque()
        self._closing: dict[str, _Closing] = {}
        self._clipped: set[str] = set()
        self._looking = ""
        self._is_ending = self._gives_way = False
        self._lost = 0
        self._tidy_at = 0.0
        self._map = MissionMap()
        self._wake = threading.Event()

    def start(self, running: Collection[str] = ()) -> None:
        """Start the thread.

        Args:
            running: ids of missions that continue after the restart; other open records are closed.
        """
        self._running = tuple(running)
        self._map.start()
        Worker(self._run, name="incidents").start()

    # -- what the patrol hands over; returns at once

    @property
    def is_written(self) -> bool:
        """Whether all entries are on the disk (pictures may follow until `finish`)."""
        return not self._entries and not (self._is_ending and self._closing)

    @property
    def needs_pictures(self) -> bool:
        """Whether pictures are needed although no mission runs."""
        return self._evidence.evidence_always or bool(self._closing) or self._album.is_waiting

    def finish(self) -> None:
        """Complete the records of finished missions without more pictures, because the program ends."""
        self._is_ending = True
        self._wake.set()

    def give_way(self, wanted: bool) -> None:
        """Suspend pictures and reports while a notice waits for room on the disk."""
        if wanted != self._gives_way:
            self._gives_way = wanted
            self._wake.set()

    def put(self, entries: Sequence[Entry]) -> None:
        """Accept entries for the records."""
        if not entries:
            return
        self._entries.extend(entries)
        self._wake.set()

    def put_picture(self, incident_id: str, file: NewFile) -> None:
        """Accept a picture for a record."""
        self._entries.append((incident_id, file))
        self._wake.set()

    def see(self, incident_id: str, stamp: float) -> None:
        """Record that somebody was confirmed in the picture of this stamp [s]."""
        self._seen.append((incident_id, stamp))
        self._wake.set()

    def note(self, sighting: Sighting) -> None:
        """Accept a detection in a picture."""
        self._album.note(sighting)

    def look(self, incident_id: str) -> None:
        """Set the mission of the present look-around, "" for none."""
        self._looking = incident_id

    # -- the thread

    def _run(self) -> None:
        while not rospy.is_shutdown():
            self._wake.wait(self.step())
            self._wake.clear()

    def step(self) -> float:
        """Write everything available; disk errors are handled. Returns the pause until the next step [s]."""
        while len(self._entries) > _MOST:  # on this thread, because another one could remove the entry being written
            self._entries.popleft()
            self._lost += 1
        try:
            return self._work()
        except StoreError as err:
            return self._trouble(err)
        except Exception:  # a defect triggered by one record must not end the keeper
            log.error("the keeping of incidents stumbled, and goes on", exc_info=True)
            self._forget_store()
            return DISK_RETRY

    def _work(self) -> float:
        """Write everything available; returns the pause until the next step [s]. Raises StoreError."""
        store = self._store or self._open()
        while self._entries:
            self._write(store, self._entries[0])
            self._entries.popleft()
        if self._gives_way and not self._is_ending:
            self._tidy(store)
            return _IDLE
        self._collect(store)
        for incident_id in [i for i, closing in self._closing.items() if self._is_due(i, closing)]:
            self._close(store, incident_id, self._closing[incident_id])
            del self._closing[incident_id]
            self._clipped.discard(incident_id)
        self._tidy(store)
        return _BUSY if self._looking or self._closing or self._album.is_waiting else _IDLE

    def _open(self) -> IncidentStore:
        wall = time.time()
        store, said = open_store(self.state_dir, wall=wall)
        is_first, running = self._running is not None, self._running or ()
        said += repair(store, wall=wall)
        if is_first:
            said += close_abandoned(store, running, wall=wall)
            self._running = None
        for sentence in said:
            log.warning("incidents: %s", sentence)
        self._store = store
        keep_reserve(self.state_dir)
        self._catch_up(store)
        self._report.works()
        return store

    def _catch_up(self, store: IncidentStore) -> None:
        """Write the reports that are missing because the program ended."""
        for row in find_incidents(store.connection, store.path, Query(limit=_RECENT)):
            is_wanted = row.closed is not None and row.verdict in self._records.report_verdicts
            if is_wanted and not store.folder.path(row.id, REPORT).exists():
                incident = store.get(row.id)
                if incident is not None:
                    write_report(store, incident)

    def _write(self, store: IncidentStore, entry: Entry | tuple[str, NewFile]) -> None:
        if isinstance(entry, tuple):
            kept = store.get(entry[0])
            if kept is not None and kept.closed is None:
                store.add_files(entry[0], [entry[1]])
            return
        if entry.begin is not None:
            store.begin(entry.begin)
            self._album.begin(entry.incident)
        kept = store.get(entry.incident)
        if kept is None:
            log.error("an entry for the incident %s came, which has no record", entry.incident)
        elif kept.closed is not None:
            _amend(store, kept, entry)
        else:
            self._write_open(store, kept, entry)

    def _write_open(self, store: IncidentStore, kept: Incident, entry: Entry) -> None:
        changes = dict(entry.changes)
        if entry.times:
            changes["times"] = kept.times + entry.times
        if entry.path:
            changes["path"] = kept.path + entry.path
        events = entry.events
        if self._lost:
            text = f"{count_of(self._lost, 'entry was', 'entries were')} lost while the disk took nothing"
            events = (Event(wall=time.time(), kind="fault", text=text), *events)
        store.record(entry.incident, add=events, **changes)
        self._lost = 0
        if entry.closed is not None:
            deadline = time.monotonic() + self._evidence.evidence_after + _PATIENCE
            self._closing[entry.incident] = _Closing(wall=entry.closed, deadline=deadline)
            self._on_verdict(replace(kept, **changes))

    # -- pictures

    def _collect(self, store: IncidentStore) -> None:
        while self._seen:
            self._album.sight(*self._seen.popleft())
        if not self._album.is_waiting and not self._looking:
            return
        ring = self._pictures.snapshot()
        for incident_id in store.open_ids():
            files = self._album.take(incident_id, ring)
            if incident_id == self._looking:
                files += self._album.look(incident_id, ring)
            if files:
                store.add_files(incident_id, files)
            self._add_clip(store, incident_id)
        for problem in self._album.problems:
            log.error("%s", problem)
        self._album.problems.clear()

    def _is_due(self, incident_id: str, closing: _Closing) -> bool:
        if self._is_ending or time.monotonic() > closing.deadline:
            return True
        return self._album.is_over(incident_id, self._pictures.snapshot())

    def _close(self, store: IncidentStore, incident_id: str, closing: _Closing) -> None:
        kept = store.get(incident_id)
        if kept is None:
            return
        self._add_clip(store, incident_id)
        if closing.files is None:
            closing.files = [*self._album.finish(incident_id), *self._map.draw(kept)]
        if kept.closed is None:
            store.add_files(incident_id, closing.files)
        incident = store.close(incident_id, wall=closing.wall)
        if incident.verdict in self._records.report_verdicts:
            write_report(store, incident)
        log.info("incident %s is on record: %s", incident.id, incident.verdict)
        self._tidy_at = 0.0

    def _add_clip(self, store: IncidentStore, incident_id: str) -> None:
        """Make the video of the seconds about a sighting, once they are over; not while the program ends."""
        if self._is_ending or incident_id in self._clipped or not self._album.has_all(incident_id):
            return
        self._clipped.add(incident_id)
        kept = store.get(incident_id)
        if kept is None:
            return
        files = [file for file in kept.files if file.role in ("before", "after")]
        try:
            read = ((file.stamp or 0.0, store.folder.read(incident_id, file.name)) for file in files)
            data = encode_clip(sorted(read, key=lambda picture: picture[0]))
        except (AlertError, StoreError) as err:
            log.error("%s", err)
            self._report.no_clip(str(err))
            return
        self._report.no_clip("")
        if data is not None:
            store.add_files(incident_id, [NewFile(name=CLIP, role="clip", data=data, caption="clip")])

    # -- the disk

    def _tidy(self, store: IncidentStore) -> None:
        if time.monotonic() < self._tidy_at:
            return
        done = prune(store, self._retention, wall=time.time())
        if done.ids:
            log.warning("incidents: %s", done.sentence)
        self._tidy_at = 0.0 if not done.is_done else time.monotonic() + _TIDY
        self._report.works(done)

    def _trouble(self, err: StoreError) -> float:
        """Report a failure, and make room on a full disk; returns the pause until the next step [s]."""
        self._report.complain(err)
        if err.is_full and self._store is not None:
            try:
                done = make_room(self._store, wall=time.time())
            except StoreError as worse:
                log.error("no room could be made for incidents: %s", worse)
            else:
                self._report.made_room(done)
                return 0.1 if done.ids else DISK_RETRY
        self._report.failed(err)
        self._forget_store()
        return DISK_RETRY

    def _forget_store(self) -> None:
        if self._store is not None:
            self._store.close_index()
        self._store = None


def _amend(store: IncidentStore, kept: Incident, entry: Entry) -> None:
    """Append news to the chain, for a mission that continued after its record was closed, such as after a crash."""
    known = f"{kept.verdict}: {kept.reason}"
    for event in entry.events:
        if event.kind == "seen" or (event.kind == "verdict" and event.text != known):
            store.amend(kept.id, wall=event.wall, text=event.text, data=event.data)
