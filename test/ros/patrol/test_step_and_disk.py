"""The patrol's step waits for no disk: what callbacks and services write they write without the locks that it wants."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

import rospy
from rosbot_patrol.srv import ArmRequest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.guard.arming import Arming, ArmingRules
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.ros.patrol import orders as patrol_orders
from rosbot_patrol.ros.patrol.calls import CallDesk

ROOMS = Rooms(tuple(Room(id=i, name=f"name {i}", pose=Pose2D()) for i in range(3)))


class SlowDisk:
    """Holds whoever writes until it is let go."""

    def __init__(self) -> None:
        self.is_writing, self.may_go = threading.Event(), threading.Event()
        self.order: list[str] = []

    def write(self) -> None:
        self.is_writing.set()
        assert self.may_go.wait(20.0)
        self.order.append("on disk")


class SlowJournal:
    def __init__(self, disk: SlowDisk) -> None:
        self.left, self._disk, self._last = [], disk, 0

    def add(self, room_id: int, wall: float) -> int:
        self._disk.write()
        self._last += 1
        return self._last

    def drop(self, taken: int) -> None:
        self._disk.write()


def in_time(work):
    """The result of what must not wait for the disk; on a thread, so that a test that fails does not hang."""
    found = []
    thread = threading.Thread(target=lambda: found.append(work()), daemon=True)
    thread.start()
    thread.join(10.0)
    assert found, "it waits for the disk"
    return found[0]


def calls_on(disk: SlowDisk) -> CallDesk:
    store = SimpleNamespace(taken=0, is_handled=lambda *_: False, note_latched=lambda *_: None)
    wake = lambda: disk.order.append("taken")  # noqa: E731
    return CallDesk(ROOMS, store, SlowJournal(disk), latched_window=10.0, wake=wake)


def test_a_call_on_its_way_to_the_disk_holds_up_no_step_and_is_taken_once_it_is_there() -> None:
    disk = SlowDisk()
    calls = calls_on(disk)
    callback = threading.Thread(target=calls.call, args=(1, ""), daemon=True)
    callback.start()
    assert disk.is_writing.wait(10.0)
    assert in_time(calls.take) == ()
    disk.may_go.set()
    callback.join(10.0)
    assert disk.order == ["on disk", "taken"]
    assert calls.take() == (1,)
    assert calls.taken == 1


def test_dropping_lines_of_the_journal_holds_up_no_step() -> None:
    disk = SlowDisk()
    calls = calls_on(disk)
    saver = threading.Thread(target=calls.note_saved, args=(frozenset(), 0), daemon=True)
    saver.start()
    assert disk.is_writing.wait(10.0)
    assert in_time(calls.take) == ()
    disk.may_go.set()
    saver.join(10.0)


def test_two_callbacks_at_once_are_numbered_in_the_order_in_which_they_are_taken() -> None:
    disk = SlowDisk()
    disk.may_go.set()
    calls = calls_on(disk)
    threads = [threading.Thread(target=calls.call, args=(room, ""), daemon=True) for room in (1, 2) for _ in range(50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
    numbers = [call.number for call in calls._calls if call.number]
    assert numbers == sorted(numbers)
    assert set(calls.take()) == {1, 2}


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """An arming desk without a master, on a slow disk; what it publishes and tells."""
    disk, published, told = SlowDisk(), [], []
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: SimpleNamespace(publish=published.append))
    monkeypatch.setattr(rospy, "get_time", lambda: 5.0)
    monkeypatch.setattr(patrol_orders, "CallerService", lambda *_: None)
    write = patrol_orders.write_json

    def slowly(path: Path, memory) -> None:
        disk.write()
        write(path, memory)

    monkeypatch.setattr(patrol_orders, "write_json", slowly)
    later: list[object] = []
    kept = tmp_path / "arming.json"
    made = patrol_orders.ArmingDesk(Arming(ArmingRules()), ROOMS, kept, told.append, later.append)
    return SimpleNamespace(desk=made, disk=disk, published=published, told=told, file=kept)


def test_a_change_of_the_mode_holds_up_no_step_and_is_answered_once_it_is_on_disk(desk) -> None:
    answers = []
    service = threading.Thread(target=lambda: answers.append(desk.desk._on_arm(ArmRequest("disarmed"))), daemon=True)
    service.start()
    assert desk.disk.is_writing.wait(10.0)
    guarded = in_time(lambda: desk.desk.step({}))
    assert guarded.mode == "disarmed"
    assert not answers
    desk.disk.may_go.set()
    service.join(10.0)
    assert answers[0].accepted
    assert '"disarmed"' in desk.file.read_text()


@pytest.mark.parametrize(
    ("modes", "kinds"),
    [
        (["disarmed"], ["disarmed"]),
        (["disarmed", "Disarmed ", "armed"], ["disarmed", "armed (armed_away)"]),
        (["armed_home", "night", "party", ""], ["armed (armed_home)", "armed (night)"]),
        (["armed_away", "armed"], []),
    ],
)
def test_every_change_is_told_with_who_and_from_where_and_what_changes_nothing_is_not(
    desk, modes: list[str], kinds: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    desk.disk.may_go.set()
    for mode in modes:
        request = ArmRequest(mode)
        request._connection_header = {"callerid": "/kitchen_panel", "rosbot_patrol_peer": "192.168.1.7"}
        desk.desk._on_arm(request)
    assert [word.kind for word in desk.told] == kinds
    for word in desk.told:
        assert word.text.startswith("the mode is ")
        assert "Ordered by /kitchen_panel on the machine 192.168.1.7, by the service /patrol/arm, 20" in word.text
    assert caplog.text.count("ordered by /kitchen_panel on the machine 192.168.1.7") == len(modes)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ({"callerid": "/a", "rosbot_patrol_peer": "127.0.0.1"}, "/a on this machine"),
        ({"callerid": "/a\nforged line", "rosbot_patrol_peer": "::1"}, "/a forged line on this machine"),
        ({}, "an unnamed program on an unknown machine"),
        (None, "an unnamed program on an unknown machine"),
    ],
)
def test_a_caller_in_words(header, said: str) -> None:
    request = ArmRequest("night")
    request._connection_header = header
    assert patrol_orders.caller_of(request) == said
