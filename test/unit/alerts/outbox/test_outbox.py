import errno
import os

import pytest

from rosbot_patrol.alerts.outbox import outbox as outbox_module
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox


def make(name, **given):
    return Notice(**{"id": name, "wall": 1.79e9, "kind": "incident", "subject": "s", "text": "t", **given})


def ids(outbox):
    return [entry.id for entry in outbox.waiting()]


def test_notices_wait_in_order_and_survive_the_program(tmp_path):
    first = Outbox(tmp_path / "out")
    for name in ("b", "a"):
        assert first.put(make(name))
    again = Outbox(tmp_path / "out")
    again.put(make("c", picture=b"\xff\xd8"))
    assert ids(first) == ids(again) == ["b", "a", "c"]
    assert first.read(first.waiting()[2]) == make("c", picture=b"\xff\xd8")


def test_the_same_notice_waits_once_and_is_known_when_it_was_delivered(tmp_path):
    outbox = Outbox(tmp_path)
    assert [outbox.put(make("a")), outbox.put(make("a"))] == [True, False]
    outbox.finish(outbox.waiting()[0])
    assert outbox.waiting() == []
    assert Outbox(tmp_path).has("a")
    assert not Outbox(tmp_path).put(make("a"))
    assert not Outbox(tmp_path).has("a-2")


def test_order_goes_on_after_all_were_delivered(tmp_path):
    outbox = Outbox(tmp_path)
    outbox.put(make("a"))
    outbox.finish(outbox.waiting()[0])
    Outbox(tmp_path).put(make("b"))
    assert Outbox(tmp_path).waiting()[0].name == "000000000002-b.notice"


def test_a_notice_is_found_while_it_waits_and_when_it_was_delivered(tmp_path):
    box = Outbox(tmp_path)
    assert box.find("one") is None
    box.put(make("one"))
    assert box.find("one") == make("one")
    box.finish(box.waiting()[0])
    assert box.find("one") == make("one")
    assert box.find("on") is None


def test_what_a_lane_has_to_know_is_known_without_the_text(tmp_path):
    outbox = Outbox(tmp_path)
    outbox.put(make("a", kind="sensor", channels=("phone",)))
    outbox.put(make("b"))
    sensor, incident = outbox.waiting()
    assert (sensor.kind, sensor.channels, sensor.is_urgent, sensor.wall) == ("sensor", ("phone",), False, 1.79e9)
    assert incident.is_urgent


def test_only_the_last_delivered_are_kept(tmp_path):
    outbox = Outbox(tmp_path, keep=2)
    for name in ("a", "b", "c"):
        outbox.put(make(name))
        outbox.finish(outbox.waiting()[0])
    outbox.tidy()
    assert sorted(path.name for path in outbox.sent.iterdir()) == ["000000000002-b.notice", "000000000003-c.notice"]


@pytest.mark.parametrize("content", [b"", b"\x00\xff garbage", b"{}"])
def test_a_file_that_is_no_notice_is_set_aside(tmp_path, content, caplog):
    outbox = Outbox(tmp_path)
    (tmp_path / "000000000001-x.notice").write_bytes(content)
    outbox.put(make("a"))
    assert ids(outbox) == ["a"]
    assert (tmp_path / "000000000001-x.broken").read_bytes() == content
    assert "000000000001-x.notice is no notice" in caplog.text


def test_a_notice_of_a_newer_version_is_left_alone_and_said_once(tmp_path, caplog):
    outbox = Outbox(tmp_path)
    data = make("x").to_bytes().replace(b'"format": 1', b'"format": 9')
    (tmp_path / "000000000001-x.notice").write_bytes(data)
    assert outbox.waiting() == outbox.waiting() == []
    assert (tmp_path / "000000000001-x.notice").read_bytes() == data
    assert caplog.text.count("is of format 9") == 1
    assert outbox.broken() == [("000000000001-x.notice", "x")]  # the owner is told what this version can tell


def full_for(times, monkeypatch):
    """os.fsync fails so often as on a full disk."""
    real, left = os.fsync, [times]

    def fsync(handle):
        if left[0] > 0:
            left[0] -= 1
            raise OSError(errno.ENOSPC, "No space left on device")
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)


def test_a_disk_that_does_not_take_it_leaves_no_half_file(tmp_path, monkeypatch):
    outbox = Outbox(tmp_path)
    full_for(1, monkeypatch)
    with pytest.raises(OSError, match="No space left"):
        outbox.put(make("a"))
    assert [path.name for path in tmp_path.iterdir()] == ["sent"]
    outbox.put(make("a"))
    assert ids(outbox) == ["a"]


def test_a_full_disk_takes_a_notice_out_of_the_reserve(tmp_path, monkeypatch, caplog):
    outbox = Outbox(tmp_path)
    outbox.tidy()
    assert (tmp_path / "reserve").stat().st_size == outbox_module.RESERVE
    full_for(1, monkeypatch)
    outbox.put(make("a", picture=b"x" * 100_000))
    assert ids(outbox) == ["a"]
    assert (tmp_path / "reserve").stat().st_size < outbox_module.RESERVE - 100_000
    assert "the disk is full" in caplog.text
    outbox.tidy()
    assert (tmp_path / "reserve").stat().st_size == outbox_module.RESERVE


def test_the_scratch_file_of_a_process_that_lives_is_left_alone(tmp_path):
    outbox = Outbox(tmp_path)
    scratch = tmp_path / f".x.{os.getppid()}.tmp"
    scratch.write_text("")
    os.utime(scratch, (0, 0))
    outbox.tidy()
    assert scratch.exists()
