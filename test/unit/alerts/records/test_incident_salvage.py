import random
import shutil
import sqlite3
from pathlib import Path

import pytest

from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.records.repair import close_abandoned, repair
from rosbot_patrol.alerts.records.salvage import open_store
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError

WALL = 1_790_000_000.0
ASIDE = "incidents.sqlite.broken-20260921T141320Z"


def fill(folder, make_incident, count=3, close=True):
    with IncidentStore(folder, wall=1.0) as store:
        for i in range(count):
            store.begin(make_incident(id=f"m{i:03}", reason="x" * 500))
            store.record(f"m{i:03}", add=[Event(wall=1.0, kind="note", text="y" * 500)])
            store.add_files(f"m{i:03}", [NewFile(name="a.jpg", role="best", data=b"%d" % i)])
            if close:
                store.close(f"m{i:03}", wall=2.0)


def test_a_sound_database_is_opened_without_a_word(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    store, said = open_store(quick_disk, wall=WALL)
    assert said == []
    assert repair(store, wall=WALL) == []
    assert verify(store).records == 3


@pytest.mark.parametrize("content", [b"", b"no database" * 400, b"SQLite format 3\0" + bytes(5000)])
def test_what_is_no_database_is_set_aside_and_not_deleted(quick_disk, content):
    (quick_disk / "incidents.sqlite").write_bytes(content)
    store, said = open_store(quick_disk, wall=WALL)
    assert verify(store).fits
    if content:  # an empty file is a database that was never begun
        assert f"set aside as {ASIDE}, a new one begun, and 0 incidents copied" in said[0]
        assert (quick_disk / ASIDE).read_bytes() == content


def test_another_programs_database_is_set_aside(quick_disk):
    with sqlite3.connect(quick_disk / "incidents.sqlite") as other:
        other.execute("CREATE TABLE songs (title)")
    _, said = open_store(quick_disk, wall=WALL)
    assert "is a database, but not one of incidents; it was set aside" in said[0]


def test_what_can_be_read_of_a_damaged_one_is_copied(quick_disk, make_incident):
    fill(quick_disk, make_incident, count=60)
    with IncidentStore(quick_disk) as store:
        store.begin(make_incident(id="running"))
        store.record("running", add=[Event(wall=1.0, kind="note", text="kept")])
        store.amend("m059", wall=3.0, text="added")
    path = quick_disk / "incidents.sqlite"
    data = bytearray(path.read_bytes())
    pages = random.Random(3).sample(range(20, len(data) // 4096), 4)
    for page in pages:
        data[page * 4096 : page * 4096 + 4096] = random.Random(page).randbytes(4096)
    path.write_bytes(data)
    store, said = open_store(quick_disk, wall=WALL)
    assert "is damaged" in said[0]
    done = verify(store)
    assert done.fits, done.problems
    assert 30 <= done.records < 61
    assert f"{done.records + done.open} incidents copied" in said[0]
    assert path.with_name(ASIDE).exists()
    assert open_store(quick_disk, wall=WALL)[1] == []


def test_a_truncated_one_gives_what_is_left(quick_disk, make_incident):
    fill(quick_disk, make_incident, count=60)
    path = quick_disk / "incidents.sqlite"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2 + 100])
    store, said = open_store(quick_disk, wall=WALL)
    assert len(said) == 1
    assert verify(store).fits


def test_a_later_versions_database_is_left_as_it_is(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    path = quick_disk / "incidents.sqlite"
    with sqlite3.connect(path) as later:
        later.execute("PRAGMA user_version=9")
        later.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    before = path.read_bytes()
    for _ in range(2):
        store, said = open_store(quick_disk, wall=WALL)
        assert "is of version 9" in said[0]
        assert "incidents.v2.sqlite beside it" in said[0]
        assert repair(store, wall=WALL) == []
        store.close_database()
    assert path.read_bytes() == before
    assert (quick_disk / "incidents" / "m000" / "a.jpg").exists()
    with IncidentStore(quick_disk, read_only=True) as store:
        assert verify(store).records == 0


def test_a_database_of_an_earlier_version_is_set_aside_and_its_records_are_copied(quick_disk, make_incident):
    with IncidentStore(quick_disk, wall=1.0) as store:
        for i, wall in enumerate((10.0, 30.0, 20.0, 40.0)):
            store.begin(make_incident(id=f"m{i}", wall=wall))
            store.close(f"m{i}", wall=wall)
        for statement in ("DROP INDEX incidents_late", "DROP INDEX incidents_in_order"):
            store.connection.execute(statement)
        store.connection.execute("ALTER TABLE incidents DROP COLUMN late")
        store.connection.execute("PRAGMA user_version=1")
    with pytest.raises(StoreError, match="is of version 1; the patrol makes a new one"):
        IncidentStore(quick_disk, read_only=True)
    store, said = open_store(quick_disk, wall=WALL)
    assert len(said) == 1
    assert "is of version 1, this program knows version 2; it was set aside as" in said[0]
    assert "4 incidents copied" in said[0]
    rows = store.connection.execute("SELECT late FROM incidents ORDER BY seq").fetchall()
    assert [row["late"] for row in rows] == [0, 0, 1, 0]
    assert verify(store).records == 4
    assert verify(store).fits


def test_what_a_crash_left_between_folder_and_database_is_put_right(quick_disk, make_incident):
    fill(quick_disk, make_incident, count=2, close=False)
    root = quick_disk / "incidents"
    (root / "m000" / "late.jpg").write_bytes(b"late")
    (root / "m000" / ".half.jpg.77.tmp").write_bytes(b"ha")
    (root / "m001" / "a.jpg").unlink()
    store, _ = open_store(quick_disk, wall=WALL)
    assert repair(store, wall=WALL) == [
        "incident m000: the file late.jpg was found after a crash",
        "incident m001: the file a.jpg was lost in a crash",
    ]
    assert not (root / "m000" / ".half.jpg.77.tmp").exists()
    assert [file.name for file in store.get("m000").files] == ["a.jpg", "late.jpg"]
    assert repair(store, wall=WALL) == []
    said = close_abandoned(store, ["m001"], wall=WALL)
    assert said == ["incident m000 was still open and is closed now, confirmed: " + "x" * 500]
    assert verify(store).fits


def test_files_of_a_removed_record_go_at_the_next_start(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    kept = quick_disk / "kept"
    shutil.copytree(quick_disk / "incidents" / "m001", kept)
    with IncidentStore(quick_disk) as store:
        store.remove("m001", wall=3.0, why="age")
        shutil.copytree(kept, quick_disk / "incidents" / "m001")
        assert repair(store, wall=WALL) == ["incident m001 had been removed; its files are gone now, too"]
        assert store.folder.ids() == {"m000", "m002"}


def test_a_folder_that_cannot_be_used_is_one_sentence(quick_disk):
    (quick_disk / "state").write_text("a file")
    with pytest.raises(StoreError, match=r"state/incidents.sqlite: "):
        open_store(quick_disk / "state", wall=WALL)
    with pytest.raises(StoreError, match=r"incidents.sqlite: "):
        open_store(Path("/proc/nowhere"), wall=WALL)
