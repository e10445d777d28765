"""A database of version 1.0 becomes files, with the very same texts, digests and hashes."""

import hashlib
import random
import shutil
import sqlite3

import pytest
from database_1_0 import Database

from rosbot_patrol.alerts.records import import_1_0
from rosbot_patrol.alerts.records.incident import Event, StoredFile
from rosbot_patrol.alerts.records.opening import open_store
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.repair import repair
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError

WALL = 1_790_000_000.0
ASIDE = "incidents.sqlite.broken-20260921T141320Z"
JPEG = b"\xff\xd8 jpeg"
PICTURE = StoredFile(name="a.jpg", role="best", sha256=hashlib.sha256(JPEG).hexdigest(), size=len(JPEG), stamp=1.5)


@pytest.fixture
def old(quick_disk, make_incident):
    """Three closed records, one of them amended; one that was removed; one that is open."""
    database = Database(quick_disk)
    for i, wall in enumerate((10.0, 30.0, 20.0, 40.0)):
        event = Event(wall=wall, kind="sensor", text=f"sensor {i}", data={"sensor": i})
        made = make_incident(id=f"m{i}", wall=wall, closed=wall + 5.0, events=(event,), files=(PICTURE,))
        database.closed(made, ("a.jpg", JPEG))
    database.amend("m1", "the plumber")
    shutil.rmtree(database.root / "m3")
    database.remove("m3")
    running = make_incident(id="open", wall=60.0, verdict="", events=(Event(wall=61.0, kind="note", text="a dog"),))
    database.open(running, ("late.jpg", JPEG))
    yield database
    database.close()


def start(folder):
    """As the patrol does; returns store and sentences."""
    store, said = open_store(folder, wall=WALL)
    return store, said + repair(store, wall=WALL)


def check_all(store, links):
    """All is there as 1.0 had it."""
    done = verify(store)
    assert done.fits, done.problems
    assert (done.records, done.removed, done.open, done.files) == (3, 1, 1, 3)
    lines = [line.link for line in store.chain.lines()]
    for line, link in zip(lines, links, strict=True):
        assert {**vars(line), "body": None} == {**vars(link), "body": None}
        name = {"record": "record.json", "amendment": f"amendment-{link.n}.json"}.get(link.kind)
        if name and link.body is not None:
            assert (store.folder.root / link.incident / name).read_bytes() == link.body.encode()
        elif name is None:
            assert line.body == link.body
    assert [note.text for note in store.amendments("m1")] == ["the plumber"]
    assert store.get("m0").events[0].data == {"sensor": 0}
    assert store.get("open").events[0].text == "a dog"
    assert "late.jpg" in [file.name for file in store.get("open").files]
    found = find_incidents(store.connection, store.path, Query())
    assert [row.id for row in found] == ["open", "m1", "m2", "m0"]
    assert [row.id for row in find_incidents(store.connection, store.path, Query(text="plumb"))] == ["m1"]


@pytest.mark.parametrize("is_closed", [True, False], ids=["clean", "a WAL that was not checkpointed"])
def test_it_is_taken_over_with_the_same_texts_and_hashes(old, quick_disk, is_closed):
    links = old.links()
    if is_closed:
        old.close()
    else:
        assert old.path.with_name("incidents.sqlite-wal").stat().st_size
    store, said = start(quick_disk)
    assert said[0] == (
        f"{old.path} is of version 1.0; its 4 incidents were taken over as files,"
        " and it was renamed to incidents.sqlite.imported"
    )
    check_all(store, links)
    assert not list(quick_disk.glob("incidents.sqlite"))
    assert (quick_disk / "incidents.sqlite.imported").exists()
    assert start(quick_disk)[1] == []
    store.close("open", wall=90.0, verdict="clear")
    assert store.link("open").previous == links[-1].hash


def test_nothing_but_the_patrol_takes_it_over(old, quick_disk):
    before = sorted(path.name for path in quick_disk.rglob("*"))
    with pytest.raises(StoreError, match=r"is of version 1.0; the patrol takes its incidents over when it starts"):
        IncidentStore(quick_disk, read_only=True)
    assert sorted(path.name for path in quick_disk.rglob("*")) == before


class Killed(BaseException):
    """The program ends here."""


@pytest.mark.parametrize("step", range(30))
def test_a_start_that_is_killed_half_way_is_completed_by_the_next(old, quick_disk, monkeypatch, step):
    links = old.links()
    left = [step]

    def kill_in(real):
        def call(*given, **named):
            if not left[0]:
                raise Killed
            left[0] -= 1
            done = real(*given, **named)
            if not left[0]:
                raise Killed
            left[0] -= 1
            return done

        return call

    with monkeypatch.context() as patch:
        for name in ("_write", "write_atomic", "_rename", "sync_folder"):
            patch.setattr(import_1_0, name, kill_in(getattr(import_1_0, name)))
        patch.setattr(import_1_0.os, "sync", kill_in(import_1_0.os.sync))
        try:
            start(quick_disk)
        except Killed:
            pass
        else:
            assert step > 16  # it has fewer steps
    if step == 4:
        path = quick_disk / "incidents" / "m0" / "record.json"  # a power cut
        path.write_bytes(path.read_bytes()[:100])
    store, _ = start(quick_disk)
    check_all(store, links)
    names = {path.name.partition("-")[0] for path in quick_disk.glob("incidents.sqlite*")}
    assert names == {"incidents.sqlite.imported"}


def test_what_can_be_read_of_a_damaged_one_is_copied(quick_disk, make_incident):
    old = Database(quick_disk)
    for i in range(60):
        old.closed(make_incident(id=f"m{i:03}", reason="x" * 900, closed=2.0))
    old.amend("m059", "added")
    old.open(make_incident(id="running", events=(Event(wall=1.0, kind="note", text="kept"),)))
    old.close()
    data = bytearray(old.path.read_bytes())
    for page in random.Random(3).sample(range(12, len(data) // 4096), 3):
        data[page * 4096 : page * 4096 + 4096] = random.Random(page).randbytes(4096)
    old.path.write_bytes(data)
    store, said = start(quick_disk)
    assert "is damaged" in said[0]
    assert f"it was set aside as {ASIDE}" in said[0]
    done = verify(store)
    assert done.fits, done.problems
    assert 30 <= done.records < 61
    assert f"{done.records + done.open} incidents copied" in said[0]
    assert (quick_disk / ASIDE).read_bytes() == data
    assert start(quick_disk)[1] == []


def test_a_truncated_one_gives_what_is_left(quick_disk, make_incident):
    old = Database(quick_disk)
    for i in range(60):
        old.closed(make_incident(id=f"m{i:03}", reason="x" * 900, closed=2.0))
    old.close()
    old.path.write_bytes(old.path.read_bytes()[: old.path.stat().st_size // 2 + 100])
    store, said = start(quick_disk)
    assert len(said) == 1
    assert verify(store).fits


@pytest.mark.parametrize("content", [b"", b"no database" * 400, b"SQLite format 3\0" + bytes(5000)])
def test_what_is_no_database_is_set_aside_and_not_deleted(quick_disk, content):
    (quick_disk / "incidents.sqlite").write_bytes(content)
    store, said = start(quick_disk)
    assert verify(store).fits
    assert f"it was set aside as {ASIDE}, and 0 incidents copied" in said[0]
    assert (quick_disk / ASIDE).read_bytes() == content
    assert start(quick_disk)[1] == []


def test_another_programs_database_is_set_aside(quick_disk):
    with sqlite3.connect(quick_disk / "incidents.sqlite") as other:
        other.execute("CREATE TABLE songs (title)")
    _, said = start(quick_disk)
    assert "is not a database of incidents; it was set aside" in said[0]


def test_a_later_versions_database_is_left_as_it_is(old, quick_disk):
    old.sql.execute("PRAGMA user_version=9")
    old.close()
    before = old.path.read_bytes()
    for _ in range(2):
        store, said = open_store(quick_disk, wall=WALL)
        assert said == [f"{old.path} is of version 9, made by a later version of this program; it is left as it is"]
        store.close_index()
    assert old.path.read_bytes() == before
    assert (quick_disk / "incidents" / "m0" / "a.jpg").exists()


def test_one_of_an_earlier_version_gives_its_records(quick_disk, make_incident):
    old = Database(quick_disk, version=1)
    for i in range(3):
        old.closed(make_incident(id=f"m{i}", closed=2.0))
    old.sql.execute("ALTER TABLE incidents DROP COLUMN late")
    old.close()
    store, said = start(quick_disk)
    assert "is of version 1, before 1.0; it was set aside as" in said[0]
    assert "3 incidents copied" in said[0]
    assert verify(store).records == 3
    assert verify(store).fits


def test_one_that_appears_beside_a_chain_gives_its_records(old, quick_disk, make_incident):
    """Version 1.0 had run again: its chain is another one."""
    old.close()
    store, _ = start(quick_disk)
    store.close_index()
    again = Database(quick_disk)
    again.closed(make_incident(id="n0", closed=2.0))
    again.amend("n0", "again")
    again.close()
    store, said = start(quick_disk)
    assert "lay beside the incidents of this version; it was set aside as incidents.sqlite.imported-2" in said[0]
    assert "1 incident copied" in said[0]
    assert store.get("n0").id == "n0"
    assert [note.text for note in store.amendments("n0")] == ["again"]
    assert verify(store).fits
    assert verify(store).records == 4


def test_a_disk_without_the_room_for_it_is_said_before_anything_is_written(old, quick_disk, monkeypatch):
    usage = shutil.disk_usage(quick_disk)
    monkeypatch.setattr(import_1_0.shutil, "disk_usage", lambda _: usage._replace(free=100))
    before = sorted(path.name for path in quick_disk.rglob("*"))
    with pytest.raises(StoreError, match="its incidents need 0 MB as files, and 0 MB are free") as caught:
        open_store(quick_disk, wall=WALL)
    assert caught.value.is_full
    assert sorted(path.name for path in quick_disk.rglob("*")) == before
