"""The post of a node on a disk that fails in every way: each notice leaves once; no master, no threads."""

import errno
import fcntl
import shutil
import time

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from post import Box, channel, notice

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.delivery import Clocks
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.ros.post import owner_post
from rosbot_patrol.ros.post.owner_post import OwnerPost
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK


class Health:
    def __init__(self):
        self.levels = {}

    def set(self, part, level, message, values=None):
        self.levels[part] = level

    def drop(self, part):
        self.levels.pop(part, None)


class Clock:
    """Time that the test moves, for the post and what it is made of."""

    now = 1000.0

    def monotonic(self):
        return self.now

    def time(self):
        return 1_790_000_000.0 + self.now

    def __getattr__(self, name):
        return getattr(Clock.real, name)


class House:
    def __init__(self, folder, boxes, clock):
        self.folder, self.boxes, self.health = folder, boxes, Health()
        self.clock = clock
        clocks = Clocks(now=clock.monotonic, wall=clock.time)
        self.post = OwnerPost(MailParams(), folder, self.health, clocks=clocks)

    def run(self, seconds):
        """As its threads do, for some time."""
        end = self.clock.now + seconds
        while self.clock.now < end:
            pause = self.post._pass()
            for name in self.boxes:
                while self.post._send(name)[0] is not None:
                    pass
            self.clock.now += min(pause, 0.5)

    @property
    def ids(self):
        return {name: [i for i in box.ids if not i.startswith("disk-")] for name, box in self.boxes.items()}

    @property
    def words(self):
        return [i.rsplit("-", 1)[0] for i in self.boxes["mail"].ids if i.startswith("disk-")]


@pytest.fixture
def make(tmp_path, monkeypatch):
    clock = Clock()
    Clock.real = time
    monkeypatch.setattr("rosbot_patrol.ros.post.health.time", clock)
    boxes = {"mail": Box(), "phone": Box()}
    channels = [channel(name, box, first_delay=0.1) for name, box in boxes.items()]
    monkeypatch.setattr(owner_post, "make_channels", lambda *_, **__: channels)

    def build(folder=tmp_path / "state"):
        return House(folder, boxes, clock)

    return build


def nudge(house):
    house.post._spare.nudge()
    house.post._dispatcher.nudge()


ONCE = {"mail": ["a"], "phone": ["a"]}


def test_on_a_disk_that_is_well_nothing_is_told_of_it(make):
    house = make()
    assert house.post.put(notice("a"))
    house.run(120.0)
    assert (house.ids, house.words) == (ONCE, [])
    assert house.health.levels["outbox"] == OK


def break_folder(folder):
    shutil.rmtree(folder)
    folder.write_text("no folder")


@pytest.mark.parametrize("first", [True, False])
def test_a_folder_that_becomes_a_file(make, first):
    house = make()
    if first:
        house.run(5.0)
    else:
        house.folder.mkdir()
    break_folder(house.folder)
    assert not house.post.put(notice("a"))
    assert not house.post.is_written
    house.run(20.0)
    assert (house.ids, house.words) == (ONCE, ["disk-gone"])
    assert house.health.levels["outbox"] == ERROR
    house.folder.unlink()
    house.run(60.0)
    assert (house.ids, house.words) == (ONCE, ["disk-gone", "disk-back"])
    assert house.health.levels["outbox"] == OK
    assert house.post.is_written
    assert Outbox(house.folder / "outbox").waits("a") is False
    again = make(house.folder)
    again.run(5.0)
    assert again.ids == ONCE


def test_a_folder_that_is_removed_while_a_notice_waits(make):
    house = make()
    for box in house.boxes.values():
        box.down = "no network"
    house.post.put(notice("a"))
    house.run(5.0)
    shutil.rmtree(house.folder)
    house.run(5.0)
    for box in house.boxes.values():
        box.down = ""
    nudge(house)
    house.run(10.0)
    nudge(house)
    house.run(30.0)
    assert house.ids == ONCE


def test_what_one_channel_took_before_the_folder_was_removed_goes_to_the_other_only(make):
    house = make()
    house.boxes["phone"].down = "no network"
    house.post.put(notice("a"))
    house.run(5.0)
    shutil.rmtree(house.folder)
    house.run(5.0)
    house.boxes["phone"].down = ""
    nudge(house)
    house.run(30.0)
    assert house.ids == ONCE


def test_a_lock_that_cannot_be_opened(make):
    house = make()
    (house.folder / "outbox" / "lock").mkdir(parents=True)
    house.post.put(notice("a"))
    house.run(30.0)
    assert house.ids == ONCE
    assert house.health.levels["outbox"] == ERROR
    assert house.post.is_written  # its file is there
    (house.folder / "outbox" / "lock").rmdir()
    house.run(60.0)
    assert house.ids == ONCE
    assert house.health.levels["outbox"] == OK


def test_a_disk_that_knows_no_locks(make, monkeypatch):
    house = make()

    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    with monkeypatch.context() as patched:
        patched.setattr(fcntl, "flock", refuse)
        house.post.put(notice("a"))
        house.run(30.0)
        assert house.ids == ONCE
    house.run(60.0)
    assert house.ids == ONCE


def test_receipts_that_cannot_be_used(make):
    house = make()
    (house.folder / "outbox" / "taken.jsonl").mkdir(parents=True)
    house.post.put(notice("a"))
    house.run(30.0)
    assert house.ids == ONCE
    assert house.health.levels["outbox"] == ERROR
    (house.folder / "outbox" / "taken.jsonl").rmdir()
    house.run(60.0)
    assert house.ids == ONCE
    assert house.health.levels["outbox"] == OK


@pytest.mark.parametrize("code", [errno.EROFS, errno.ENOSPC, errno.EIO, errno.EACCES, errno.EDQUOT])
def test_a_disk_that_refuses_to_write(make, monkeypatch, code):
    house = make()
    house.run(5.0)

    def refuse(*_, **__):
        raise OSError(code, "refused")

    with monkeypatch.context() as patched:
        patched.setattr("rosbot_patrol.files.write_whole", refuse)
        for name in ("a", "b"):
            assert not house.post.put(notice(name))
        house.run(5.0)
        assert house.ids == {"mail": ["a", "b"], "phone": ["a", "b"]}
        assert house.words == []  # that may be over in a moment
        house.run(60.0)
    house.run(60.0)
    assert house.ids == {"mail": ["a", "b"], "phone": ["a", "b"]}
    assert house.words == ["disk-gone", "disk-back"]
    assert house.post.is_written


def test_a_disk_that_comes_and_goes_sends_nothing_twice(make, monkeypatch):
    house = make()
    house.run(2.0)

    def refuse(*_, **__):
        raise OSError(errno.EIO, "refused")

    for number in range(6):
        with monkeypatch.context() as patched:
            patched.setattr("rosbot_patrol.files.write_whole", refuse)
            house.boxes["phone"].down = "no network" if number % 2 else ""
            house.post.put(notice(f"n{number}"))
            house.run(3.0)
        house.run(7.0)
    house.boxes["phone"].down = ""
    nudge(house)
    house.run(30.0)
    assert {name: sorted(ids) for name, ids in house.ids.items()} == {
        name: [f"n{number}" for number in range(6)] for name in house.boxes
    }


def test_two_programs_with_one_folder_tell_of_the_disk_once(make, monkeypatch):
    first = make()
    first.run(5.0)
    second = make()
    second.run(1.0)

    def refuse(*_, **__):
        raise OSError(errno.EROFS, "refused")

    with monkeypatch.context() as patched:
        patched.setattr("rosbot_patrol.files.write_whole", refuse)
        for _ in range(60):
            first.run(1.0)
            second.run(1.0)
    for _ in range(20):
        first.run(1.0)
        second.run(1.0)
    assert first.words == ["disk-gone", "disk-back"]
