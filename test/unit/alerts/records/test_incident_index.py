"""The index may go, be damaged, lag behind or run ahead: it is made anew of the files."""

import shutil
import sqlite3
from contextlib import closing

import pytest

from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.repair import repair
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError

_ROWS = """SELECT id, wall, room_id, room_name, origin, verdict, reason, share, object_class, closed, link, bytes,
    record_bytes, tags, words FROM incidents ORDER BY id"""


def fill(folder, make_incident):
    with IncidentStore(folder, wall=1.0) as store:
        for i, wall in enumerate((10.0, 30.0, 20.0, 40.0, 50.0)):
            store.begin(make_incident(id=f"m{i}", wall=wall))
            store.record(f"m{i}", add=[Event(wall=wall, kind="note", text=f"word{i}")])
            store.close(f"m{i}", wall=wall + 5.0)
        store.amend("m1", wall=70.0, text="the plumber")
        store.remove("m3", wall=80.0, why="age")
        store.begin(make_incident(id="open", wall=60.0, verdict=""))
    return rows(folder)


def rows(folder):
    with IncidentStore(folder, read_only=True) as store:
        return [tuple(row) for row in store.connection.execute(_ROWS)]


def index(folder):
    return folder / "incidents" / "index.sqlite"


def names(folder):
    """Without those that SQLite makes of a WAL to read it."""
    return sorted(path.name for path in folder.rglob("*") if not path.name.endswith(("-wal", "-shm")))


def remove(folder):
    for path in folder.glob("incidents/index.sqlite*"):
        path.unlink()


def damage_pages(folder):
    path = index(folder)
    data = path.read_bytes()
    path.write_bytes(data[: 4096 * 5] + b"damaged!" * 2048 + data[4096 * 9 :])


def change(folder, statement):
    with closing(sqlite3.connect(index(folder))) as connection, connection:
        connection.execute(statement)


HARM = {
    "missing": remove,
    "garbage": lambda folder: index(folder).write_bytes(b"no database" * 999),
    "emptied": lambda folder: index(folder).write_bytes(b""),
    "damaged": damage_pages,
    "cut in half": lambda folder: index(folder).write_bytes(index(folder).read_bytes()[:9000]),
    "of another version": lambda folder: change(folder, "PRAGMA user_version=99"),
    "of another program": lambda folder: change(folder, "PRAGMA application_id=99"),
    "ahead of the chain": lambda folder: change(
        folder, "INSERT INTO links VALUES (99999, 100000, 99, 'record', 'x', 'hash')"
    ),
    "of another chain": lambda folder: change(folder, "UPDATE links SET hash='another' WHERE n=8"),
}


@pytest.mark.parametrize("what", HARM)
def test_an_index_of_no_use_is_made_anew_and_says_the_same(quick_disk, make_incident, what):
    known = fill(quick_disk, make_incident)
    HARM[what](quick_disk)
    with IncidentStore(quick_disk) as store:
        (said,) = store.found.said
        assert "it was made anew of the files: 5 records in " in said
        assert rows(quick_disk) == known
        found = find_incidents(store.connection, store.path, Query(text="plumb"))
        assert [row.id for row in found] == ["m1"]
        assert [row.id for row in find_incidents(store.connection, store.path, Query())] == [
            "open",
            "m4",
            "m1",
            "m2",
            "m0",
        ]
        done = verify(store)
        assert done.fits or what == "ahead of the chain", done.problems
        assert store.open_ids() == ("open",)
        assert repair(store, wall=99.0) == []
    with IncidentStore(quick_disk) as store:
        assert store.found.said == []
    assert not list(quick_disk.glob("incidents/index.sqlite.new*"))


@pytest.mark.parametrize("what", ["missing", "garbage", "emptied", "of another version", "of another program"])
def test_a_reader_makes_one_in_memory_and_writes_nothing(quick_disk, make_incident, what):
    known = fill(quick_disk, make_incident)
    HARM[what](quick_disk)
    before = names(quick_disk)
    assert rows(quick_disk) == known
    with IncidentStore(quick_disk, read_only=True) as store:
        assert verify(store).fits
    assert names(quick_disk) == before


def test_an_index_that_lags_behind_catches_up(quick_disk, make_incident):
    """As a power cut leaves it, which takes the last rows and no file."""
    fill(quick_disk, make_incident)
    shutil.copy(index(quick_disk), quick_disk / "old")
    with IncidentStore(quick_disk) as store:
        store.close("open", wall=90.0, verdict="clear")
        store.amend("m0", wall=91.0, text="the postman")
        store.remove("m2", wall=92.0, why="age")
        store.begin(make_incident(id="next", wall=93.0, verdict=""))
        store.record("next", add=[Event(wall=94.0, kind="note", text="a dog")])
    known = rows(quick_disk)
    remove(quick_disk)
    shutil.copy(quick_disk / "old", index(quick_disk))
    with IncidentStore(quick_disk) as store:
        assert store.found.said == []
        assert verify(store).fits
        assert repair(store, wall=99.0) == []
        assert [row.id for row in find_incidents(store.connection, store.path, Query(text="dog"))] == ["next"]
    assert rows(quick_disk) == known


def test_rows_out_of_the_order_of_time_are_marked(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    remove(quick_disk)
    with IncidentStore(quick_disk) as store:
        late = store.connection.execute("SELECT id FROM incidents WHERE late = 1").fetchall()
    assert [row["id"] for row in late] == ["m2"]


def test_an_index_that_cannot_be_made_leaves_nothing_half_made(quick_disk, make_incident, monkeypatch):
    fill(quick_disk, make_incident)
    remove(quick_disk)
    monkeypatch.setattr("rosbot_patrol.alerts.records.indexing.fill", fail)
    with pytest.raises(StoreError, match="No space"):
        IncidentStore(quick_disk)
    assert not list(quick_disk.glob("incidents/index.sqlite*"))
    monkeypatch.undo()
    with IncidentStore(quick_disk) as store:
        assert verify(store).fits


def fail(*_of):
    raise StoreError("index.sqlite", "No space left on device", is_full=True)


def test_one_record_needs_no_index(quick_disk, make_incident, monkeypatch):
    fill(quick_disk, make_incident)
    remove(quick_disk)
    monkeypatch.setattr("rosbot_patrol.alerts.records.store.open_for_reading", fail)
    with IncidentStore(quick_disk, read_only=True) as store:
        assert store.get("m0").id == "m0"


def test_a_write_looks_at_no_row_but_its_own(quick_disk, make_incident):
    """Among 100,000 records a scan took 35 ms a write."""
    with IncidentStore(quick_disk) as store:
        store.begin(make_incident(id="m0"))
        statements = []
        store.connection.set_trace_callback(statements.append)
        store.record("m0", add=[Event(wall=1.0, kind="note", text="x")])
        store.close("m0", wall=2.0)
        store.connection.set_trace_callback(None)
        reads = [
            words for words in statements if words.startswith(("SELECT", "UPDATE incidents", "INSERT INTO incidents "))
        ]
        assert len(reads) > 3
        for words in reads:
            plan = [row["detail"] for row in store.connection.execute(f"EXPLAIN QUERY PLAN {words}")]
            assert not [step for step in plan if "TEMP B-TREE" in step], words
