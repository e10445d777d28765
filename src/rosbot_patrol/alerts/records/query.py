"""Finding incidents: by room, verdict, time and words, the newest first, in milliseconds among 100,000."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass, replace
from pathlib import Path

from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.index import clean, person_tag, room_tag, verdict_tag

_NO_ROW = 1 << 62
_ORDERED = "FROM incidents INDEXED BY incidents_in_order WHERE late = 0"
_LATE = "FROM incidents INDEXED BY incidents_late WHERE late = 1"
_COLUMNS = "seq, id, wall, room_id, room_name, origin, verdict, reason, share, object_class, closed, bytes"


@dataclass(frozen=True, kw_only=True)
class Query:
    """Conditions on incidents; those that are not given do not matter.

    Attributes:
        room: its id; somebody was there, or it called.
        verdict: "" for those that are open.
        since, until: when the mission began, seconds since 1970.
        text: words that have to be there, or how they begin; case and accents do not matter.
        limit: largest number of results.
    """

    room: int | None = None
    verdict: str | None = None
    since: float | None = None
    until: float | None = None
    text: str = ""
    limit: int = 50


@dataclass(frozen=True, kw_only=True)
class Found:
    """One line of a list; see Incident. `bytes`: of its files."""

    seq: int
    id: str
    wall: float
    room_id: int
    room_name: str
    origin: str
    verdict: str
    reason: str
    share: float | None
    object_class: str
    closed: float | None
    bytes: int


def find_incidents(connection: sqlite3.Connection, path: Path, query: Query) -> list[Found]:
    """The incidents that fit, the newest first. Raises StoreError."""
    words = _words(query.text)
    if query.text.strip() and not words:
        return []
    with errors_of(path):
        rows = _by_words(connection, query, words) if words else _by_columns(connection, query)
        if query.room is not None and not words:
            rows = _newest(rows + _by_words(connection, replace(query, room=None), [_person(query.room)]), query.limit)
    return [Found(**dict(row)) for row in rows]


def _by_columns(connection: sqlite3.Connection, query: Query) -> list[sqlite3.Row]:
    where, values = _time_limits(query)
    for column, value in (("room_id", query.room), ("verdict", query.verdict)):
        if value is not None:
            where.append(f"{column} = ?")
            values.append(value)
    sql = f"SELECT {_COLUMNS} FROM incidents {_and(where)} ORDER BY wall DESC, seq DESC LIMIT ?"
    return connection.execute(sql, (*values, query.limit)).fetchall()


def _by_words(connection: sqlite3.Connection, query: Query, words: list[str]) -> list[sqlite3.Row]:
    # The index answers for room and verdict too, and walks its rows from the newest: no row is fetched for nothing.
    terms = [f"words : {word}" for word in words]
    if query.room is not None:
        terms.append(f'(tags : "{room_tag(query.room)}" OR words : {_person(query.room)})')
    terms += [] if query.verdict is None else [f'tags : "{verdict_tag(query.verdict)}"']
    where, values = _time_limits(query)
    first, last = _span(connection, query)
    columns = ", ".join(f"i.{name.strip()}" for name in _COLUMNS.split(","))
    more = "".join(f" AND i.{condition}" for condition in where)
    sql = f"""SELECT {columns} FROM incidents_text t CROSS JOIN incidents i ON i.seq = t.rowid
        WHERE incidents_text MATCH ? AND t.rowid BETWEEN ? AND ?{more} ORDER BY t.rowid DESC LIMIT ?"""
    return connection.execute(sql, (" AND ".join(terms), first, last, *values, query.limit)).fetchall()


def _person(room_id: int) -> str:
    return f'"{person_tag(room_id)}"'


def _newest(rows: list[sqlite3.Row], limit: int) -> list[sqlite3.Row]:
    found = {row["seq"]: row for row in rows}
    return sorted(found.values(), key=lambda row: (-row["wall"], -row["seq"]))[:limit]


def _span(connection: sqlite3.Connection, query: Query) -> tuple[int, int]:
    """First and last row that can lie in the query's time: rows are in the order of time, but for the few late ones."""

    def seq(sql: str, wall: float) -> int | None:
        row = connection.execute(sql, (wall,)).fetchone()
        return row[0] if row else None

    first, last = 0, _NO_ROW
    if query.since is not None:
        ordered = seq(f"SELECT seq {_ORDERED} AND wall >= ? ORDER BY wall, seq LIMIT 1", query.since)
        late = seq(f"SELECT min(seq) {_LATE} AND wall >= ?", query.since)
        first = min(_NO_ROW if n is None else n for n in (ordered, late))
    if query.until is not None:
        ordered = seq(f"SELECT seq {_ORDERED} AND wall < ? ORDER BY wall DESC, seq DESC LIMIT 1", query.until)
        late = seq(f"SELECT max(seq) {_LATE} AND wall < ?", query.until)
        last = max(ordered or 0, late or 0)
    return first, last


def _time_limits(query: Query) -> tuple[list[str], list[float | int | str]]:
    where: list[str] = []
    values: list[float | int | str] = []
    for condition, value in (("wall >= ?", query.since), ("wall < ?", query.until)):
        if value is not None:
            where.append(condition)
            values.append(value)
    return where, values


def _and(where: list[str]) -> str:
    return f"WHERE {' AND '.join(where)}" if where else ""


def _words(text: str) -> list[str]:
    """What people typed as terms of FTS5: each word a prefix, nothing in it means anything else."""
    parts = clean(text).split()
    words = [part for part in parts if any(map(str.isalnum, part))]
    return ['"' + word.replace('"', '""') + ('"' if len(word) == 1 and word.isascii() else '"*') for word in words]
