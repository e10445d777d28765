"""Check that the incidents on disk are unchanged: chain, records, amendments, list and pictures."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import Line
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.files import RECORD, amendment_name
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.index import columns_of, last_line, written_links
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.errors import StoreError

MAX_PROBLEMS = 20


@dataclass(frozen=True, kw_only=True)
class Verification:
    """Result of a check.

    Attributes:
        problems: sentences, the first that was found first; at most MAX_PROBLEMS.
        records, removed, open, files: how many there are, files of those checked.
        head: hash of the last link.
    """

    problems: tuple[str, ...]
    records: int
    removed: int
    open: int
    files: int
    head: str

    @property
    def fits(self) -> bool:
        """Whether nothing was changed."""
        return not self.problems


def verify(store: IncidentStore, *, files: bool = True, expect: str = "") -> Verification:
    """Check everything.

    Args:
        store: open for reading.
        files: read the pictures too.
        expect: a hash that left the robot earlier (of a mail or report); it has to be in the chain.
    """
    check = _Check(store, files)
    problems: list[str] = []
    try:
        with errors_of(store.path):
            for problem in check.run(expect):
                problems.append(problem)
                if len(problems) == MAX_PROBLEMS:
                    break
    except StoreError as err:
        problems.append(str(err))
    return Verification(
        problems=tuple(problems),
        records=check.records,
        removed=check.removed,
        open=check.open,
        files=check.files,
        head=check.before[1],
    )


class _Check:
    """One pass over the chain, the folders and the index, while others write."""

    def __init__(self, store: IncidentStore, with_files: bool) -> None:
        self._store, self._with_files = store, with_files
        self._connection = store.connection
        self._stop = 0  # byte behind the last line that counts
        self._indexed = 0  # byte behind the last line that the index has
        self._linked: set[str] = set()
        self._gone: dict[str, int] = {}
        self.before = (0, chain.START)
        self.records = self.removed = self.open = self.files = 0

    def run(self, expect: str) -> Iterator[str]:
        self._connection.execute("BEGIN")
        self._indexed = last_line(self._connection)[3]  # from here on one state, never newer than the chain's
        try:
            yield from self._links(expect)
            yield from self._folders()
        finally:
            self._connection.execute("COMMIT")

    def _links(self, expect: str) -> Iterator[str]:
        self._survey()
        is_known = not expect
        for number, line in enumerate(self._store.chain.lines(), 1):
            if line.stop > self._stop:
                break  # it came meanwhile
            if line.link is None:
                yield f"line {number} of {self._store.chain.path.name} makes no sense: it was damaged"
                continue
            is_known = is_known or line.link.hash == expect
            yield from self._link(line, line.link)
        written = written_links(self._connection)
        if written > self.before[0]:
            yield f"the chain ends at link {self.before[0]}, but {written} were written: the last ones were removed"
        if not is_known:
            yield f"no link has the hash {expect}: this is not the chain that it came from, or its end is gone"

    def _survey(self) -> None:
        """Note which records the chain has, and which of them were removed by which link."""
        for line in self._store.chain.lines():
            self._stop = line.stop
            if line.link is not None and line.link.kind == chain.RECORD:
                self._linked.add(line.link.incident)
            elif line.link is not None and line.link.kind == chain.REMOVAL:
                self._gone[line.link.incident] = line.link.n

    def _link(self, line: Line, link: chain.Link) -> Iterator[str]:
        what = f"the {link.kind} of {link.incident or 'the chain'} (link {link.n})"
        problem = chain.link_problem(link, self.before)
        self.before = (link.n, link.hash)
        if problem:
            yield f"{what} does not fit: {problem}"
        elif link.kind in (chain.RECORD, chain.AMENDMENT):
            if link.n > self._gone.get(link.incident, 0):
                yield from self._body(line, link, what)
        elif link.body is None:
            yield f"{what} does not fit: its content is gone"
        elif link.kind == chain.REMOVAL:
            self.removed += 1

    def _body(self, line: Line, link: chain.Link, what: str) -> Iterator[str]:
        is_record = link.kind == chain.RECORD
        text = self._store.folder.text(link.incident, RECORD if is_record else amendment_name(link.n))
        if text is None:
            if link.incident not in self._removed_since():
                yield f"{what} does not fit: its content is gone, and nothing in the chain says why"
            return
        self.records += is_record
        if chain.digest(text) != link.digest:
            yield f"{what} does not fit: its {link.kind} is not the one that was hashed: it was changed"
        elif is_record:
            yield from self._record(line, self._store.folder.parse(link.incident, text), what)

    def _record(self, line: Line, incident: Incident, what: str) -> Iterator[str]:
        row = self._connection.execute("SELECT * FROM incidents WHERE id=?", (incident.id,)).fetchone()
        if line.stop <= self._indexed:
            if row is None:
                yield f"{what} does not fit: it is missing in the list of incidents"
            elif row["link"] != (line.link and line.link.n) or _differs(row, incident):
                yield f"{what} does not fit: the list of incidents says something else, it was changed"
        if self._with_files:
            for file in incident.files:
                self.files += 1
                problem = self._store.folder.problem(incident.id, file)
                if problem and incident.id not in self._removed_since():
                    yield f"{what} does not fit: {problem}"

    def _folders(self) -> Iterator[str]:
        rows = self._connection.execute("SELECT id, closed FROM incidents").fetchall()
        listed_open = {row["id"] for row in rows if row["closed"] is None}
        for row in rows:
            if row["closed"] is not None and row["id"] not in self._linked:
                yield f"the list has an incident {row['id']} that the chain does not have"
        unlinked = sorted(self._store.folder.ids() - self._linked)
        later = {line.link.incident for line in self._store.chain.lines(self._stop) if line.link}
        for incident_id in unlinked:
            try:
                kept = self._store.get(incident_id)
            except StoreError as err:
                yield f"the record of {incident_id} does not fit: {err.problem}"
                continue
            if kept is None:
                continue
            if kept.closed is None or incident_id in listed_open | later:  # it is being closed, or was in a crash
                self.open += 1
            else:
                yield f"there is a record of {incident_id} that the chain does not have: it was added"

    def _removed_since(self) -> set[str]:
        """What was removed while the check ran."""
        lines = self._store.chain.lines(self._stop)
        return {line.link.incident for line in lines if line.link and line.link.kind == chain.REMOVAL}


def _differs(row: sqlite3.Row, incident: Incident) -> bool:
    own = columns_of(incident)
    return any(row[name] != value for name, value in own.items() if name != "words")  # amendments add words
