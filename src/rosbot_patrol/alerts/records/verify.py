"""Check that the incidents on disk are unchanged: chain, records, lists and files."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.database import columns_of, errors_of
from rosbot_patrol.alerts.records.incident import Incident, incident_from_plain
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
    def __init__(self, store: IncidentStore, with_files: bool) -> None:
        self._store, self._with_files = store, with_files
        self._connection = store.connection
        self.before = (0, chain.START)
        self.records = self.removed = self.open = self.files = 0

    def run(self, expect: str) -> Iterator[str]:
        damage = self._connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        if damage != "ok":
            yield f"the database is damaged: {damage.splitlines()[0]}"
        self._connection.execute("BEGIN")  # one state of it, while others write
        try:
            yield from self._links(expect)
            yield from self._rows()
        finally:
            self._connection.execute("COMMIT")

    def _links(self, expect: str) -> Iterator[str]:
        gone = {
            row["incident"]
            for row in self._connection.execute("SELECT incident FROM links WHERE kind=?", (chain.REMOVAL,))
        }
        is_known = not expect
        for row in self._connection.execute("SELECT * FROM links ORDER BY n"):
            link = chain.Link(**dict(row))
            is_known = is_known or link.hash == expect
            what = f"the {link.kind} of {link.incident or 'the database'} (link {link.n})"
            problem = chain.link_problem(link, self.before)
            self.before = (link.n, link.hash)
            if problem:
                yield f"{what} does not fit: {problem}"
            elif link.kind == chain.REMOVAL:
                self.removed += 1
            elif link.body is None:
                if link.incident not in gone:
                    yield f"{what} does not fit: its content is gone, and nothing in the chain says why"
            elif link.kind == chain.RECORD:
                self.records += 1
                yield from self._record(link, what)
        written = self._connection.execute("SELECT seq FROM sqlite_sequence WHERE name='links'").fetchone()
        if written is not None and written[0] > self.before[0]:
            yield f"the chain ends at link {self.before[0]}, but {written[0]} were written: the last ones were removed"
        if not is_known:
            yield f"no link has the hash {expect}: this is not the chain that it came from, or its end is gone"

    def _record(self, link: chain.Link, what: str) -> Iterator[str]:
        try:
            incident = incident_from_plain(json.loads(link.body or ""))
        except (ValueError, TypeError, KeyError, AttributeError) as err:
            yield f"{what} makes no sense: {err!r}"
            return
        row = self._connection.execute("SELECT * FROM incidents WHERE id=?", (link.incident,)).fetchone()
        if incident.id != link.incident:
            yield f"{what} does not fit: it holds the record of {incident.id}"
        elif row is None:
            yield f"{what} does not fit: it is missing in the list of incidents"
        elif row["link"] != link.n or _differs(row, incident):
            yield f"{what} does not fit: the list of incidents says something else, it was changed"
        if self._with_files:
            for file in incident.files:
                self.files += 1
                problem = self._store.folder.problem(incident.id, file)
                if problem:
                    yield f"{what} does not fit: {problem}"

    def _rows(self) -> Iterator[str]:
        strays = """SELECT i.id FROM incidents i LEFT JOIN links l ON l.n = i.link
            WHERE i.closed IS NOT NULL AND (l.n IS NULL OR l.incident != i.id OR l.kind != ?) ORDER BY i.seq"""
        for row in self._connection.execute(strays, (chain.RECORD,)):
            yield f"the list has an incident {row['id']} that the chain does not have"
        self.open = self._connection.execute("SELECT count(*) FROM incidents WHERE closed IS NULL").fetchone()[0]


def _differs(row: sqlite3.Row, incident: Incident) -> bool:
    own = columns_of(incident)
    return any(row[name] != value for name, value in own.items() if name != "words")  # amendments add words
