"""The outbox of one program with its memory behind the disk. On broken disks: test/ros/post/test_owner_post.py."""

import errno
import shutil

import pytest
from post import Box, Time, channel, notice, send_all, spare

from rosbot_patrol.alerts.dispatch.safe_outbox import RECENT, RECENT_PERIOD, RETRY, SafeOutbox
from rosbot_patrol.alerts.outbox.disk_watch import DiskWatch
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipts


class House:
    def __init__(self, folder):
        self.time, self.mail, self.failures, self.calls = Time(), Box(), [], 0
        self.outbox = Outbox(folder / "outbox")
        self.spare = spare(channel("mail", self.mail), time=self.time)
        self.disk = DiskWatch(folder)
        self.box = SafeOutbox(
            self.outbox,
            Receipts(self.outbox.folder / "taken.jsonl"),
            self.spare,
            self.disk,
            clocks=self.time.clocks,
            on_failure=self.failures.append,
            on_spare=self.count,
        )

    def count(self):
        self.calls += 1


@pytest.fixture
def house(tmp_path):
    return House(tmp_path)


@pytest.fixture
def refuse(monkeypatch):
    def refuse(code):
        def fail(*_, **__):
            raise OSError(code, "refused")

        monkeypatch.setattr("rosbot_patrol.files.write_whole", fail)

    return refuse


def test_a_notice_goes_to_the_disk_and_not_to_the_memory(house):
    assert house.box.put(notice("a"))
    assert house.box.has("a")
    assert house.outbox.waits("a")
    assert (len(house.spare), house.calls, house.failures) == (0, 0, [])


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EROFS])
def test_what_the_disk_refuses_leaves_from_memory_once_and_is_written_later(house, refuse, monkeypatch, code):
    refuse(code)
    assert not house.box.put(notice("a"))
    assert not house.box.put(notice("a"))
    assert house.box.has("a")
    assert not house.box.is_written
    assert house.box.is_disk_full is (code != errno.EROFS)
    assert send_all(house.spare, "mail")[0].delivered
    with pytest.raises(OSError, match="refused"):
        house.box.save()
    assert not house.box.save()  # not again at once
    monkeypatch.undo()
    house.time.now += RETRY
    assert house.box.save()
    assert house.box.is_written
    assert (house.mail.ids, len(house.spare), house.calls) == (["a"], 0, 1)
    assert house.outbox.waits("a")
    assert Receipts(house.outbox.folder / "taken.jsonl").read_new()[0].ids == ("a",)


def test_a_notice_with_a_file_that_is_gone_leaves_from_memory(house):
    house.box.put(notice("a"))
    shutil.rmtree(house.outbox.folder)
    house.box.watch_recent()
    assert len(house.spare) == 1
    house.box.watch_recent()
    assert (len(house.spare), house.calls) == (1, 1)


def test_without_a_lock_all_recent_notices_leave_from_memory(house):
    for number in range(RECENT + 2):
        house.box.put(notice(f"n{number}"))
    house.box.watch_recent()
    assert len(house.spare) == 0
    house.box.is_stuck = True
    house.time.now += RECENT_PERIOD
    house.box.watch_recent()
    assert house.spare.ids == [f"n{number}" for number in range(2, RECENT + 2)]
    assert house.box.is_written
