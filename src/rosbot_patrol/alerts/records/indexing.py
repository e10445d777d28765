"""The index follows the files: opening, catching up with the chain, and making it anew."""

from __future__ import annotations

import json
import sqlite3
import time
from contextlib import suppress
from dataclasses import dataclass, field

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import ChainFile
from rosbot_patrol.alerts.records.disk_errors import errors_of
from rosbot_patrol.alerts.records.files import IncidentFolder, amendment_name
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.index import (
    NAME,
    SCRATCH,
    add_words,
    last_line,
    make_index,
    make_index_in_memory,
    open_index,
    put_incident,
    put_link,
    read_index,
    remove_index,
    transaction,
    written_links,
)
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import sync_folder


@dataclass(kw_only=True)
class Found:
    """What somebody has to know of the files.

    Attributes:
        damaged: incidents with a record that cannot be read.
        said: sentences.
    """

    damaged: set[str] = field(default_factory=set)
    said: list[str] = field(default_factory=list)


def open_for_writing(files: IncidentFolder, links: ChainFile, found: Found) -> sqlite3.Connection:
    """The index, as new as the files; made anew where it is of no use. The caller holds the chain's lock.

    Raises:
        StoreError: the disk does not take it.
    """
    path = files.root / NAME
    written = 0
    try:
        connection = open_index(path)
    except StoreError as err:
        if not err.is_corrupt:
            raise
        why = err.problem
    else:
        why = _difference(connection, links)
        if not why:
            with transaction(connection, path):
                catch_up(connection, files, links, found)
            return connection
        with suppress(sqlite3.Error):
            written = written_links(connection)
        connection.close()
    began = time.monotonic()
    count = _make_anew(files, links, found, written)
    if count or why != "is missing":
        took = f"{count_of(count, 'record')} in {time.monotonic() - began:.1f} s"
        found.said.append(f"{path} {why}; it was made anew of the files: {took}")
    return open_index(path)


def _make_anew(files: IncidentFolder, links: ChainFile, found: Found, written: int) -> int:
    """Make the index beside its place, then move it there; returns the number of its records. Raises StoreError."""
    path = files.root / NAME
    scratch = path.with_name(SCRATCH)
    connection = make_index(scratch)
    try:
        with transaction(connection, scratch):
            fill(connection, files, links, found)
            connection.execute("UPDATE written SET n=max(n, ?)", (written,))
            connection.execute("INSERT INTO incidents_text(incidents_text) VALUES ('optimize')")  # for quick searches
            count = int(connection.execute("SELECT count(*) FROM incidents").fetchone()[0])
    except StoreError:
        connection.close()
        remove_index(scratch)
        raise
    connection.close()
    with errors_of(path):
        remove_index(path)  # with its WAL: SQLite would apply it to the new file
        scratch.replace(path)
        sync_folder(files.root)
    return count


def open_for_reading(files: IncidentFolder, links: ChainFile) -> sqlite3.Connection:
    """The index as it is; where it is of no use, another one in memory. Raises StoreError."""
    path = files.root / NAME
    with suppress(StoreError), errors_of(path):
        return read_index(path)
    connection = make_index_in_memory()
    with transaction(connection, path):
        fill(connection, files, links, Found())
    return connection


def _difference(connection: sqlite3.Connection, links: ChainFile) -> str:
    """Why the index does not belong to the chain; "" if it does."""
    n, known_hash, start, stop = last_line(connection)
    link = links.line(start, stop).link if n else None
    if n and (link is None or (link.n, link.hash) != (n, known_hash)):
        last = links.head()[0]
        return f"knows {n} links, but the chain ends at link {last}" if last < n else "is that of another chain"
    return ""


def catch_up(connection: sqlite3.Connection, files: IncidentFolder, links: ChainFile, found: Found) -> None:
    """Follow the links that the index does not have yet. Raises StoreError."""
    for line in links.lines(last_line(connection)[3]):
        link = line.link
        if link is None:
            continue
        put_link(connection, line, link)
        if link.kind == chain.RECORD:
            record = _read(files, link.incident, found)
            if record is not None:  # None: it was removed later, or `verify` names it
                put_incident(connection, *record, link.n)
        elif link.kind == chain.AMENDMENT:
            with suppress(StoreError, ValueError, KeyError, TypeError):  # `verify` names it
                text = json.loads(files.text(link.incident, amendment_name(link.n)) or "")["text"]
                add_words(connection, link.incident, str(text))
        elif link.kind == chain.REMOVAL:
            connection.execute("DELETE FROM incidents WHERE id=?", (link.incident,))


def fill(connection: sqlite3.Connection, files: IncidentFolder, links: ChainFile, found: Found) -> None:
    """Write an empty index. Raises StoreError."""
    catch_up(connection, files, links, found)
    for incident_id in sorted(strays(connection, files) - removed_ids(connection)):
        put_open(connection, files, incident_id, found)


def strays(connection: sqlite3.Connection, files: IncidentFolder) -> set[str]:
    """The incidents that have a folder and no row. Raises StoreError."""
    return files.ids() - {row["id"] for row in connection.execute("SELECT id FROM incidents")}


def removed_ids(connection: sqlite3.Connection) -> set[str]:
    """The incidents that retention removed."""
    rows = connection.execute("SELECT incident FROM links WHERE kind=?", (chain.REMOVAL,))
    return {row["incident"] for row in rows}


def put_open(connection: sqlite3.Connection, files: IncidentFolder, incident_id: str, found: Found) -> None:
    """Write the row of a record that the chain does not have."""
    record = _read(files, incident_id, found)
    if record is not None:
        put_incident(connection, *record)


def _read(files: IncidentFolder, incident_id: str, found: Found) -> tuple[Incident, int] | None:
    """A record and the size of its text; None if there is none that can be read."""
    try:
        text = files.text(incident_id)
        return None if text is None else (files.parse(incident_id, text), len(text))
    except ValueError:  # the name in a damaged link is none of a folder
        return None
    except StoreError as err:
        if err.is_corrupt:
            found.damaged.add(incident_id)
        else:
            found.said.append(str(err))
        return None
