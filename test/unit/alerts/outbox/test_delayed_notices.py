"""Notices that wait for an entry delay, and calls that start no mission, on disk."""

import json

from rosbot_patrol.alerts.outbox.delayed_notices import DelayedNotices
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.patrol.calls.ignored_log import MOST, IgnoredLog
from rosbot_patrol.patrol.records.commands import Ignored


def test_a_notice_waits_and_is_gone_when_removed(tmp_path):
    held = DelayedNotices(tmp_path / "held")
    assert held.get("a-1") is None
    notice = Notice(id="a-1", wall=1.0, kind="incident", subject="s", text="t", picture=b"jpeg")
    held.put(notice)
    assert DelayedNotices(tmp_path / "held").get("a-1") == notice
    held.remove("a-1")
    held.remove("a-1")
    assert not held.has("a-1")


def test_calls_are_lines_and_the_file_does_not_grow_for_ever(tmp_path):
    path = tmp_path / "ignored.jsonl"
    log = IgnoredLog(path)
    log.add((Ignored(wall=5.0, room_id=3, why="the house is disarmed"),))
    assert json.loads(path.read_text())["room_id"] == 3
    path.write_bytes(b"x" * (MOST + 1))
    log.add((Ignored(wall=6.0, room_id=4, why="w"),))
    assert len(path.read_text().splitlines()) == 1
    assert (tmp_path / "ignored.old.jsonl").exists()
