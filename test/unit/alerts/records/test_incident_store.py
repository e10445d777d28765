import errno
import hashlib
import shutil

import pytest

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import ChainFile
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Event, incident_from_plain, incident_to_plain
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError

ID = "20261121T010203Z-1"


@pytest.fixture
def store(quick_disk):
    with IncidentStore(quick_disk, wall=1.0) as store:
        yield store


def picture(name="a.jpg", data=b"jpeg", **given):
    return NewFile(name=name, role="best", data=data, **given)


def test_a_record_reads_back_while_open_and_when_closed(store, make_incident, quick_disk):
    store.begin(make_incident(verdict="", closed=None))
    store.record(ID, times=(("driving", 10.0), ("looking", 20.0)), share_seen=0.96)
    store.record(ID, add=[Event(wall=11.0, kind="sensor", text="sensor 3 sees motion", data={"sensor": 3})])
    store.add_files(ID, [picture(stamp=61.5, caption="Küche")])
    for reader in (store, IncidentStore(quick_disk, read_only=True)):
        kept = reader.get(ID)
        assert (kept.verdict, kept.closed, kept.share_seen) == ("", None, 0.96)
        assert kept.events[0].data == {"sensor": 3}
        assert (kept.files[0].name, kept.files[0].size, kept.files[0].caption) == ("a.jpg", 4, "Küche")
    closed = store.close(ID, wall=30.0, verdict="confirmed", reason="a person")
    assert closed == IncidentStore(quick_disk, read_only=True).get(ID)
    assert closed.durations() == (("driving", 10.0), ("looking", 10.0))
    assert store.folder.read(ID, "a.jpg") == b"jpeg"
    assert store.link(ID).hash == store.head()[1]


def test_what_was_written_is_there_for_another_program_at_once(store, make_incident, quick_disk):
    store.begin(make_incident())
    store.record(ID, add=[Event(wall=1.0, kind="note", text="x")])
    with IncidentStore(quick_disk, read_only=True) as other:
        assert len(other.get(ID).events) == 1
        assert other.open_ids() == (ID,)


def test_beginning_and_closing_again_changes_nothing(store, make_incident):
    store.begin(make_incident(verdict=""))
    store.begin(make_incident(verdict="", room_name="another"))
    first = store.close(ID, wall=2.0, verdict="clear")
    assert store.close(ID, wall=3.0, verdict="confirmed") == first
    store.begin(make_incident(verdict=""))
    assert store.get(ID) == first
    assert store.head()[0] == 2


def test_a_closed_record_takes_amendments_only(store, make_incident):
    store.begin(make_incident())
    with pytest.raises(StoreError, match="no closed incident"):
        store.amend(ID, wall=2.0, text="too early")
    before = store.close(ID, wall=2.0)
    for write in (
        lambda: store.record(ID, reason="another"),
        lambda: store.record(ID, add=[Event(wall=3.0, kind="note", text="x")]),
        lambda: store.add_files(ID, [picture()]),
    ):
        with pytest.raises(StoreError, match="is closed"):
            write()
    assert [path.name for path in (store.folder.root / ID).iterdir()] == ["record.json"]
    store.amend(ID, wall=4.0, text="it was the neighbour", data={"by": "owner"})
    assert store.get(ID) == before
    (added,) = store.amendments(ID)
    assert (added.text, added.data) == ("it was the neighbour", {"by": "owner"})


def test_a_removed_record_leaves_its_digest(store, make_incident):
    for name in ("a", "b"):
        store.begin(make_incident(id=name))
        store.add_files(name, [picture()])
        store.close(name, wall=2.0)
    store.amend("a", wall=3.0, text="more")
    with pytest.raises(StoreError, match="no closed incident"):
        store.remove("c", wall=4.0, why="age")
    store.remove("a", wall=4.0, why="age")
    assert store.get("a") is None
    assert not store.folder.path("a").exists()
    assert store.folder.read("b", "a.jpg") == b"jpeg"
    kinds = ["begun", "record", "record", "amendment", "removal"]
    assert [line.link.kind for line in store.chain.lines()] == kinds
    assert "age" in [line.link.body for line in store.chain.lines()][-1]
    assert not list(store.folder.root.rglob("amendment*"))


@pytest.mark.parametrize("name", ["../x", "", ".hidden", "a/b", "a\0b", "ü"])
def test_what_is_no_name_of_a_file_is_refused(store, make_incident, name):
    with pytest.raises(ValueError, match="is no"):
        store.begin(make_incident(id=name))
    store.begin(make_incident())
    with pytest.raises(ValueError, match="is no name"):
        store.add_files(ID, [picture(name=name) if name else picture(name=" ")])


def test_strange_texts_are_kept(store, make_incident):
    store.begin(make_incident(room_name="<script>\0 台所 \U0001f600 \ud800", reason="'; DROP TABLE links; --"))
    store.record(ID, add=[Event(wall=1.0, kind="note", text="\0\n\u2028", data={"x": float("inf")})])
    kept = store.close(ID, wall=2.0)
    assert store.get(ID).room_name == "<script>\0 台所 \U0001f600 ?"
    assert store.get(ID).events[0].data == {"x": None}
    assert kept.reason == "'; DROP TABLE links; --"


def test_too_many_events_are_not_all_kept(store, make_incident, monkeypatch):
    monkeypatch.setattr("rosbot_patrol.alerts.records.store.MAX_EVENTS", 3)
    store.begin(make_incident())
    store.record(ID, add=[Event(wall=float(i), kind="sensor", text=str(i)) for i in range(9)])
    texts = [event.text for event in store.get(ID).events]
    assert texts == ["0", "1", "2", "more than 3 events came; the others are not kept"]


def test_a_record_of_a_later_form_is_read(make_incident):
    plain = incident_to_plain(make_incident())
    assert incident_from_plain({**plain, "mood": "good"}) == make_incident()


def test_the_chain_goes_on_from_program_to_program(quick_disk, make_incident):
    for i in range(3):
        with IncidentStore(quick_disk, wall=float(i)) as store:
            store.begin(make_incident(id=f"m{i}"))
            store.close(f"m{i}", wall=float(i))
    with IncidentStore(quick_disk) as store:
        rows = [line.link for line in store.chain.lines()]
    before = (0, chain.START)
    for link in rows:
        assert chain.link_problem(link, before) == ""
        before = (link.n, link.hash)
    assert [link.kind for link in rows] == ["begun", "record", "record", "record"]


def test_two_writers_keep_one_chain(store, make_incident, quick_disk):
    with IncidentStore(quick_disk) as other:
        for i in range(6):
            one = (store, other)[i % 2]
            one.begin(make_incident(id=f"m{i}"))
            one.close(f"m{i}", wall=float(i))
    assert store.head()[0] == 7


def test_reading_makes_nothing(quick_disk):
    with pytest.raises(StoreError, match="there is none; the patrol makes it"):
        IncidentStore(quick_disk, read_only=True)
    assert list(quick_disk.iterdir()) == []


def test_the_record_of_a_closed_one_is_the_text_that_the_chain_hashed(store, make_incident):
    store.begin(make_incident(room_name="台所 \ud800"))
    store.close(ID, wall=2.0)
    data = (store.folder.path(ID, "record.json")).read_bytes()
    assert hashlib.sha256(data).hexdigest() == store.link(ID).digest
    assert store.link(ID).body.encode() == data


@pytest.mark.parametrize("name", ["record.json", "amendment-3.json", "report.html", "record.json.broken-1"])
def test_a_picture_cannot_take_the_place_of_a_record(store, make_incident, name):
    store.begin(make_incident())
    with pytest.raises(ValueError, match="is no name"):
        store.add_files(ID, [picture(name=name)])
    assert store.get(ID).files == ()


def test_a_full_disk_is_said_as_such_and_the_record_stays_as_it_was(store, make_incident, monkeypatch):
    store.begin(make_incident())
    monkeypatch.setattr("rosbot_patrol.alerts.records.files.write_whole", refuse)
    with pytest.raises(StoreError) as caught:
        store.record(ID, add=[Event(wall=1.0, kind="note", text="x" * 100_000)])
    assert caught.value.is_full
    assert store.get(ID).events == ()
    monkeypatch.undo()
    store.record(ID, add=[Event(wall=1.0, kind="note", text="small")])
    assert len(store.get(ID).events) == 1


def refuse(*_of):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_closing_that_the_chain_refuses_is_completed_by_the_next_try(store, make_incident, monkeypatch):
    store.begin(make_incident())
    monkeypatch.setattr("rosbot_patrol.alerts.records.chain_file.append_line", refuse)
    for _ in range(2):
        with pytest.raises(StoreError, match="No space"):
            store.close(ID, wall=2.0, verdict="clear")
    monkeypatch.undo()
    assert store.close(ID, wall=3.0, verdict="confirmed").closed == 2.0
    assert store.get(ID).verdict == "clear"
    assert (store.link(ID).wall, store.head()[0]) == (2.0, 2)
    assert verify(store).fits


def test_an_index_that_is_full_holds_up_the_next_call_and_doubles_nothing(store, make_incident):
    store.begin(make_incident())
    pages = store.connection.execute("PRAGMA page_count").fetchone()[0]
    store.connection.execute(f"PRAGMA max_page_count={pages}")
    store.record(ID, add=[Event(wall=1.0, kind="note", text=" ".join(f"word{i}" for i in range(900)))])
    assert len(store.get(ID).events) == 1  # the file is written, the index is behind
    with pytest.raises(StoreError) as caught:
        store.record(ID, add=[Event(wall=2.0, kind="note", text="more")])
    assert caught.value.is_full
    assert len(store.get(ID).events) == 1
    store.connection.execute("PRAGMA max_page_count=100000")
    store.record(ID, add=[Event(wall=2.0, kind="note", text="more")])
    assert [row.id for row in find_incidents(store.connection, store.path, Query(text="word33 more"))] == []
    assert [row.id for row in find_incidents(store.connection, store.path, Query(text="word33"))] == [ID]
    assert len(store.get(ID).events) == 2


def test_a_chain_that_another_program_holds_is_waited_for_and_then_said(store, make_incident, monkeypatch):
    monkeypatch.setattr("rosbot_patrol.alerts.records.chain_file.LOCK_TIMEOUT", 0.05)
    store.begin(make_incident())
    with (
        ChainFile(store.chain.path).locked(),
        pytest.raises(StoreError, match="locked"),
    ):
        store.close(ID, wall=2.0)
    assert store.close(ID, wall=2.0).closed == 2.0


def test_a_folder_that_vanishes_is_said(store, make_incident):
    store.begin(make_incident())
    shutil.rmtree(store.folder.root)
    with pytest.raises(StoreError, match="is not there"):
        store.record(ID, reason="x")
    with pytest.raises(StoreError, match="No such file"):
        store.close(ID, wall=2.0)
    assert not store.folder.root.exists()
