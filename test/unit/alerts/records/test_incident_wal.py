"""What is finished outlives a WAL that is emptied, cut or removed."""

import logging
import shutil
import sqlite3
from dataclasses import replace

import pytest

from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.retention import RetentionParams, prune
from rosbot_patrol.alerts.records.salvage import open_store
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify

WALL = 1_790_000_000.0
DONE = Incident(id="a", wall=WALL, room_id=3, room_name="kitchen", verdict="confirmed", reason="a person")


def killed(folder, *steps):
    """A copy of the folder as a kill leaves it after these steps, the WAL beside the database."""
    store = IncidentStore(folder / "state", wall=WALL)
    for step in steps:
        step(store)
    shutil.copytree(folder / "state", folder / "killed")
    store.close_database()
    return folder / "killed"


def finish(name):
    def step(store):
        store.begin(replace(DONE, id=name))
        store.record(name, reason="somebody")
        store.close(name, wall=WALL + 60.0)

    return step


def begin(name):
    return lambda store: (store.begin(replace(DONE, id=name)), store.record(name, reason="somebody"))


def harm(folder, how):
    wal = folder / "incidents.sqlite-wal"
    (folder / "incidents.sqlite-shm").unlink(missing_ok=True)
    if how == "removed":
        wal.unlink(missing_ok=True)
    elif how == "emptied":
        wal.write_bytes(b"")
    elif how == "zeroed":
        wal.write_bytes(bytes(wal.stat().st_size))
    else:
        wal.write_bytes(wal.read_bytes()[: wal.stat().st_size // 3])


def records(folder):
    store, _ = open_store(folder, wall=WALL)
    with store:
        assert verify(store, files=False).fits
        return {row["id"] for row in store.connection.execute("SELECT id FROM incidents WHERE closed IS NOT NULL")}


@pytest.mark.parametrize("how", ["emptied", "removed", "zeroed", "cut"])
def test_finished_records_are_in_the_database(tmp_path, how):
    folder = killed(tmp_path, finish("a"), finish("b"), begin("c"))
    harm(folder, how)
    assert records(folder) >= {"a", "b"}


@pytest.mark.parametrize("how", ["emptied", "removed"])
def test_amendments_and_removals_are_in_the_database(tmp_path, how):
    def amend(store):
        store.amend("b", wall=WALL + 90.0, text="it was the cat")

    def remove(store):
        prune(store, RetentionParams(keep_days=0.0, keep_clear_days=0.0, keep_mb=1e9, keep_free_mb=0.0), wall=WALL)

    folder = killed(tmp_path, finish("a"), finish("b"), amend, remove)
    harm(folder, how)
    with IncidentStore(folder, read_only=True) as store:
        assert [event.text for event in store.amendments("b")] == ["it was the cat"]


def test_a_database_that_was_just_begun_is_one_without_its_wal(tmp_path):
    folder = killed(tmp_path)
    harm(folder, "emptied")
    assert records(folder) == set()


def test_one_who_reads_for_long_holds_it_up_and_nothing_else(tmp_path):
    with IncidentStore(tmp_path, wall=WALL) as store:
        finish("a")(store)
        reader = sqlite3.connect(tmp_path / "incidents.sqlite", isolation_level=None)
        reader.execute("BEGIN")
        reader.execute("SELECT count(*) FROM incidents").fetchone()
        finish("b")(store)
        assert not store.settle()
        reader.execute("COMMIT")
        reader.close()
        assert store.settle()
        assert (tmp_path / "incidents.sqlite-wal").stat().st_size == 0


def test_every_cut_of_the_wal_keeps_what_is_finished(tmp_path):
    logging.disable(logging.CRITICAL)
    folder = killed(tmp_path, finish("a"), begin("b"))
    wal = (folder / "incidents.sqlite-wal").read_bytes()
    assert wal  # of the mission that runs
    for size in range(0, len(wal), max(len(wal) // 25, 1)):
        again = tmp_path / f"cut{size}"
        shutil.copytree(folder, again)
        (again / "incidents.sqlite-wal").write_bytes(wal[:size])
        (again / "incidents.sqlite-shm").unlink(missing_ok=True)
        assert "a" in records(again)
    logging.disable(logging.NOTSET)
