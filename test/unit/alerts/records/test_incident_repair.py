"""What a crash leaves in between is mended by the next start, which says so."""

import shutil
from pathlib import Path

import pytest

from rosbot_patrol.alerts.records import chain_file, files, indexing
from rosbot_patrol.alerts.records import store as store_module
from rosbot_patrol.alerts.records.chain_file import ChainFile
from rosbot_patrol.alerts.records.files import IncidentFolder, NewFile
from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.records.opening import open_store
from rosbot_patrol.alerts.records.repair import close_abandoned, repair
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError

WALL = 1_790_000_000.0
ASIDE = "broken-20260921T141320Z"


def fill(folder, make_incident, count=3, close=True):
    with IncidentStore(folder, wall=1.0) as store:
        for i in range(count):
            store.begin(make_incident(id=f"m{i:03}", reason="x" * 500))
            store.record(f"m{i:03}", add=[Event(wall=1.0, kind="note", text="y" * 500)])
            store.add_files(f"m{i:03}", [NewFile(name="a.jpg", role="best", data=b"%d" % i)])
            if close:
                store.close(f"m{i:03}", wall=2.0)


def start(folder):
    """As the patrol does; returns store and sentences."""
    store, said = open_store(folder, wall=WALL)
    return store, said + repair(store, wall=WALL)


def chain_path(folder):
    return folder / "incidents" / "chain.jsonl"


def test_sound_files_are_opened_without_a_word(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    store, said = start(quick_disk)
    assert said == []
    assert verify(store).records == 3


class Killed(BaseException):
    """The program ends here."""


STEPS = {  # of a closing, each after what stands before it
    "the scratch of the record": (files, "write_whole"),
    "the name of the record": (files, "sync_folder"),
    "the whole record": (IncidentFolder, "write_record"),
    "the end of the chain": (ChainFile, "cut_tail"),
    "the link": (ChainFile, "append"),
    "the index of the record": (indexing, "put_incident"),
    "the index": (store_module, "catch_up"),
}


@pytest.mark.parametrize("is_before", [True, False])
@pytest.mark.parametrize("is_with_index", [True, False])
@pytest.mark.parametrize("step", STEPS)
def test_a_closing_that_ends_at_any_step_is_whole_or_still_open(
    quick_disk, make_incident, monkeypatch, step, is_before, is_with_index
):
    fill(quick_disk, make_incident, count=1)
    store, _ = start(quick_disk)
    store.begin(make_incident(id="last", verdict=""))
    place, name = STEPS[step]
    real = getattr(place, name)

    def kill(*given, **named):
        if not is_before:
            real(*given, **named)
        raise Killed

    monkeypatch.setattr(place, name, kill)
    with pytest.raises(Killed):
        store.close("last", wall=5.0, verdict="clear")
    monkeypatch.undo()
    if is_with_index:
        with IncidentStore(quick_disk, read_only=True) as reader:
            assert verify(reader).fits
    else:
        for path in quick_disk.glob("incidents/index.sqlite*"):
            path.unlink()
    store, _ = start(quick_disk)
    close_abandoned(store, [], wall=WALL)
    done = verify(store)
    assert done.fits, done.problems
    assert (done.records, done.open) == (2, 0)
    assert [line.link.incident for line in store.chain.lines()] == ["", "m000", "last"]
    assert store.get("last").verdict in ("clear", "unverified")
    assert start(quick_disk)[1] == []


def test_a_closed_record_without_a_link_gets_it(quick_disk, make_incident, monkeypatch):
    fill(quick_disk, make_incident)
    path = chain_path(quick_disk)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]))
    store, said = start(quick_disk)
    assert said[1] == "incident m002 was closed without a link in the chain; it has one now"
    assert path.read_bytes().splitlines(keepends=True) == lines  # the very same link
    assert verify(store).fits


@pytest.mark.parametrize("cut", [1, 30, 150, "zeroes"])
def test_a_link_that_was_cut_off_is_dropped_and_said(quick_disk, make_incident, cut):
    fill(quick_disk, make_incident)
    path = chain_path(quick_disk)
    whole = path.read_bytes()
    path.write_bytes(whole + bytes(300) if cut == "zeroes" else whole[:-cut])
    with IncidentStore(quick_disk, read_only=True) as reader:
        assert reader.head()[0] == (4 if cut == "zeroes" else 3)
    store, said = start(quick_disk)
    assert "bytes of a link that was cut off; they are gone" in said[0]
    assert path.read_bytes() == whole
    assert verify(store).fits


def test_every_cut_of_the_chain_leaves_all_records(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    whole = chain_path(quick_disk).read_bytes()
    for size in range(0, len(whole), 41):
        again = quick_disk / f"cut{size}"
        shutil.copytree(quick_disk / "incidents", again / "incidents")
        chain_path(again).write_bytes(whole[:size])
        store, _ = start(again)
        done = verify(store)
        assert done.records == 3
        assert done.problems == ()
        store.close_index()


def test_a_chain_without_sense_is_set_aside_and_all_records_are_linked_anew(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    chain_path(quick_disk).write_bytes(b"damaged\n" * 9)
    with IncidentStore(quick_disk, read_only=True) as reader:
        assert "line 1 of chain.jsonl makes no sense" in verify(reader).problems[0]
    store, said = start(quick_disk)
    assert f"holds no link that makes sense; it was set aside as chain.jsonl.{ASIDE}, and a new one begun" in said[0]
    assert [line for line in said if "has one now" in line]
    assert (verify(store).records, verify(store).fits) == (3, True)
    assert "holds no link" in next(store.chain.lines()).link.body
    assert (quick_disk / "incidents" / f"chain.jsonl.{ASIDE}").read_bytes() == b"damaged\n" * 9


def test_a_damaged_line_of_the_chain_stays_named_and_its_record_is_linked_anew(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    path = chain_path(quick_disk)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], b"#" * 40 + b"\n", lines[3]]))
    for _ in range(2):
        store, _ = start(quick_disk)
        problems = verify(store).problems
        assert "line 3 of chain.jsonl makes no sense" in problems[0]
        assert store.get("m001").id == "m001"
        store.close_index()


@pytest.mark.parametrize("data", [b"", b"{", b"\xff\xfe", b"[]", b"7", b'{"id": "m001"}', b"[" * 100_000])
@pytest.mark.parametrize("close", [True, False])
def test_a_damaged_record_is_set_aside_and_all_others_live_on(quick_disk, make_incident, data, close):
    fill(quick_disk, make_incident, close=close)
    path = quick_disk / "incidents" / "m001" / "record.json"
    path.write_bytes(data)
    for index in quick_disk.glob("incidents/index.sqlite*"):
        index.unlink()
    store, said = start(quick_disk)
    said = [line for line in said if "made anew" not in line]
    assert said[0] == f"the record of incident m001 makes no sense; it was set aside as record.json.{ASIDE}"
    assert path.with_name(f"record.json.{ASIDE}").read_bytes() == data
    assert store.get("m001") is None
    assert store.get("m000").files[0].name == "a.jpg"
    assert store.get("m002").events[0].text == "y" * 500
    done = verify(store)
    assert done.fits is not close
    assert not close or "record of m001 (link 3) does not fit: its content is gone" in done.problems[0]


def test_a_damaged_record_of_a_running_mission_is_set_aside_with_the_index_there(quick_disk, make_incident):
    fill(quick_disk, make_incident, close=False)
    (quick_disk / "incidents" / "m001" / "record.json").write_bytes(b"{")
    store, said = start(quick_disk)
    assert said[0].startswith("the record of incident m001 makes no sense")
    assert store.open_ids() == ("m000", "m002")


def test_what_a_crash_left_between_folder_and_record_is_put_right(quick_disk, make_incident):
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


def test_a_folder_without_a_record_is_left_alone(quick_disk, make_incident):
    fill(quick_disk, make_incident)
    (quick_disk / "incidents" / "notes").mkdir()
    _, said = start(quick_disk)
    assert said == [f"1 folder in {quick_disk}/incidents has no record here and is left alone"]


def test_a_folder_that_cannot_be_used_is_one_sentence(quick_disk):
    (quick_disk / "state").write_text("a file")
    with pytest.raises(StoreError, match=r"state/incidents"):
        open_store(quick_disk / "state", wall=WALL)
    with pytest.raises(StoreError, match=r"nowhere/incidents: "):
        open_store(Path("/proc/nowhere"), wall=WALL)


def test_an_amendment_without_its_link_counts_for_nothing(quick_disk, make_incident, monkeypatch):
    fill(quick_disk, make_incident)
    store, _ = start(quick_disk)
    with monkeypatch.context() as patch:
        patch.setattr(chain_file, "append_line", kill_now)
        with pytest.raises(Killed):
            store.amend("m001", wall=3.0, text="half")
    store, said = start(quick_disk)
    assert said == []
    assert store.amendments("m001") == ()
    store.amend("m001", wall=4.0, text="whole")
    assert [note.text for note in store.amendments("m001")] == ["whole"]
    assert verify(store).fits


def kill_now(*_of):
    raise Killed
