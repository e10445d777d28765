"""The keeper of incidents before disks that are full, gone or damaged; no master."""

import subprocess

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.alerts.pictures.jpeg import RawPicture
from rosbot_patrol.alerts.pictures.ring import EvidenceParams, EvidenceRing
from rosbot_patrol.alerts.records import store as store_module
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Event, Incident
from rosbot_patrol.alerts.records.retention import RetentionParams
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError
from rosbot_patrol.patrol.story.mission_log import Entry
from rosbot_patrol.ros.patrol.incident_keeper import IncidentKeeper
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN

WALL = 1_790_000_000.0


class Pictures:
    def __init__(self):
        self.ring = EvidenceRing(seconds=6.0, rate=5.0, max_bytes=40e6)

    def snapshot(self):
        return self.ring.snapshot()

    def take(self, stamp):
        self.ring.add(RawPicture(stamp=stamp, width=64, height=48, encoding="rgb8", step=192, data=bytes(9216)))


class Health:
    def __init__(self):
        self.told = []

    def set(self, part, level, message, values=None):
        self.told.append((level, message))


class House:
    def __init__(self, folder):
        self.folder, self.pictures, self.health, self.verdicts = folder, Pictures(), Health(), []
        self.keeper = self.make()

    def make(self):
        keeper = IncidentKeeper(
            self.folder,
            self.pictures,
            self.health,
            evidence=EvidenceParams(evidence_after=2.0),
            retention=RetentionParams(keep_free_mb=0.0),
            on_verdict=self.verdicts.append,
        )
        keeper._running = ()
        return keeper

    def mission(self, name, verdict="clear", size=0):
        begin = Incident(id=name, wall=WALL, room_id=1, room_name="hall")
        self.keeper.put([Entry(incident=name, begin=begin, times=(("driving", WALL),), path=((0.0, 0.0), (1.0, 0.0)))])
        if size:
            self.keeper.put_picture(name, NewFile(name="seen.jpg", role="detection", data=bytes(size)))
        changes = {"verdict": verdict, "reason": "why"}
        self.keeper.put([Entry(incident=name, times=(("looking", WALL + 1),), path=((2.0, 0.0),), changes=changes)])
        self.keeper.put([Entry(incident=name, closed=WALL + 9.0)])

    def check(self):
        with IncidentStore(self.folder, read_only=True) as store:
            done = verify(store)
            assert done.fits, done.problems
            return {i: store.get(i) for i in self.ids(store)}

    @staticmethod
    def ids(store):
        return [row["id"] for row in store.connection.execute("SELECT id FROM incidents ORDER BY seq")]


@pytest.fixture
def house(tmp_path):
    return House(tmp_path / "state")


def test_a_mission_becomes_a_closed_record_with_a_map_and_a_report(house):
    house.mission("a", "unverified")
    assert not house.keeper.is_written
    house.keeper.step()
    assert house.keeper.is_written
    kept = house.check()["a"]
    assert (kept.verdict, kept.closed) == ("unverified", WALL + 9.0)
    assert [phase for phase, _ in kept.times] == ["driving", "looking"]
    assert kept.path == ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))
    assert [file.role for file in kept.files] == ["map"]
    assert (house.folder / "incidents" / "a" / "report.html").exists()
    assert [(i.id, i.verdict) for i in house.verdicts] == [("a", "unverified")]
    (house.folder / "incidents" / "a" / "report.html").unlink()  # as if the program had ended before it
    house.make().step()
    assert (house.folder / "incidents" / "a" / "report.html").exists()
    assert house.health.told[-1] == (OK, "incidents are kept")


def test_a_record_waits_for_the_seconds_after_a_sighting_but_not_for_good(house):
    for tenth in range(100):
        house.pictures.take(100.0 + tenth / 10)
    house.mission("a", "confirmed")
    house.keeper.see("a", 109.5)
    house.keeper.step()
    assert house.check()["a"].closed is None
    assert house.verdicts[0].verdict == "confirmed"  # which is told at once
    assert house.keeper.needs_pictures
    for tenth in range(25):
        house.pictures.take(110.0 + tenth / 10)
        house.keeper.step()
    roles = [file.role for file in house.check()["a"].files]
    assert roles.count("before") >= 20
    assert roles.count("after") >= 8
    assert roles.count("clip") == 1
    assert not house.keeper.needs_pictures
    house.mission("b", "confirmed")
    house.keeper.see("b", 112.4)
    house.keeper.step()
    house.keeper.finish()  # the program ends
    house.keeper.step()
    assert house.keeper.is_written
    assert house.check()["b"].closed is not None


def test_pictures_leave_the_room_to_a_notice_that_waits_for_it(house):
    """What a full disk has left again is the notice's; the record is complete once that is written."""
    house.keeper.give_way(True)
    house.mission("a", verdict="confirmed")
    house.keeper.step()
    (record,) = house.check().values()
    assert record.verdict == "confirmed"
    assert record.closed is None
    assert [v.id for v in house.verdicts] == ["a"]
    house.keeper.give_way(False)
    house.keeper.step()
    (record,) = house.check().values()
    assert record.closed == WALL + 9.0


def test_a_program_that_ends_completes_its_records_although_a_notice_waits(house):
    house.keeper.give_way(True)
    house.mission("a")
    house.keeper.finish()
    house.keeper.step()
    (record,) = house.check().values()
    assert record.closed == WALL + 9.0


def test_a_restart_goes_on_with_a_record_and_closes_the_others(house):
    for name in ("a", "b"):
        house.keeper.put([Entry(incident=name, begin=Incident(id=name, wall=WALL, room_id=1, room_name="hall"))])
        house.keeper.put([Entry(incident=name, times=(("driving", WALL),), changes={"verdict": "confirmed"})])
    house.keeper.step()
    house.keeper = house.make()
    house.keeper._running = ("b",)
    house.mission("b", "confirmed")
    house.keeper.step()
    kept = house.check()
    assert (kept["a"].verdict, kept["a"].closed is not None) == ("confirmed", True)
    assert [phase for phase, _ in kept["b"].times] == ["driving", "driving", "looking"]


def test_what_comes_for_a_closed_record_is_added_to_the_chain(house):
    house.mission("a")
    house.keeper.step()
    event = Event(wall=WALL + 20.0, kind="verdict", text="confirmed: a person")
    same = Event(wall=WALL + 20.0, kind="verdict", text="clear: why")
    house.keeper.put([Entry(incident="a", changes={"verdict": "confirmed"}, events=(event, same))])
    house.keeper.step()
    assert house.check()["a"].verdict == "clear"
    with IncidentStore(house.folder, read_only=True) as store:
        assert [added.text for added in store.amendments("a")] == ["confirmed: a person"]


def test_a_disk_that_is_gone_is_told_and_nothing_is_lost(house, caplog):
    house.folder.write_text("not a folder")
    house.mission("a")
    for _ in range(3):
        assert house.keeper.step() == 5.0
    assert house.health.told[-1][0] == ERROR
    assert "incidents cannot be written" in caplog.text
    house.folder.unlink()
    house.keeper.step()
    assert house.check()["a"].verdict == "clear"
    assert house.health.told[-1][0] == OK


def test_an_index_that_is_damaged_while_the_robot_runs_is_made_anew(house, caplog, monkeypatch):
    house.mission("a")
    house.keeper.step()
    (house.folder / "incidents" / "index.sqlite").write_bytes(b"damaged!" * 2000)
    house.mission("b")
    with monkeypatch.context() as patch:  # SQLite notices it when its cache does not have the page
        patch.setattr(store_module, "put_incident", fail)
        for _ in range(3):
            house.keeper.step()
    assert house.health.told[-1][0] == ERROR
    house.mission("c")
    for _ in range(3):
        house.keeper.step()
    assert house.keeper.is_written
    assert "it was made anew of the files: " in caplog.text
    assert list(house.check()) == ["a", "b", "c"]
    assert house.check()["b"].path == ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))  # nothing twice


def fail(*_of):
    raise StoreError("index.sqlite", "database disk image is malformed", is_corrupt=True)


def test_a_database_of_version_1_0_is_taken_over(house, caplog):
    house.mission("a")
    house.keeper.step()
    house.keeper._forget_store()
    (house.folder / "incidents.sqlite").write_bytes(b"damaged" * 2000)
    house.mission("b")
    house.keeper.step()
    assert "it was set aside as incidents.sqlite.broken-" in caplog.text
    assert list(house.check()) == ["a", "b"]


@pytest.fixture
def small_disk(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("needs the right to mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_full_disk_loses_its_oldest_clear_incidents_and_says_so(small_disk, caplog):
    house = House(small_disk)
    house.mission("first", "confirmed", size=300_000)
    for number in range(30):
        house.mission(f"m{number:02}", "clear", size=400_000)
        for _ in range(20):
            if house.keeper.step() > 0.1:
                break
    assert house.keeper.is_written
    kept = house.check()
    assert kept["first"].verdict == "confirmed"
    assert "m29" in kept
    assert "m00" not in kept
    assert all(incident.verdict for incident in kept.values())
    assert "old incident" in caplog.text
    assert "removed: the disk is full" in caplog.text
    assert any(level == WARN and "the disk is full" in text for level, text in house.health.told)


def fill(path):
    with path.open("wb") as file:
        while True:
            file.write(bytes(65536))
            file.flush()


def test_a_disk_full_of_other_things_is_told_and_tried_again(small_disk):
    house = House(small_disk)
    house.mission("a", "confirmed", size=100_000)
    house.keeper.step()
    with pytest.raises(OSError, match="No space"):
        fill(small_disk / "other")
    house.mission("b", "confirmed", size=3_000_000)
    for _ in range(4):
        house.keeper.step()
    assert not house.keeper.is_written
    assert house.health.told[-1][0] == ERROR
    (small_disk / "other").unlink()
    for _ in range(4):
        house.keeper.step()
    assert sorted(house.check()) == ["a", "b"]
