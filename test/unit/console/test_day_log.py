"""The log of the last day: what is new in each state, over restarts, and no more than a day of it."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.console.live.day_log import DAY, DayLog, Entry
from rosbot_patrol.console.live.house_state import ArmingNow, BatteryNow, GuardNow, HouseState, Problem
from rosbot_patrol.console.sentences import day_line
from rosbot_patrol.console.words import words_of


class Clock:
    def __init__(self) -> None:
        self.now = 1.8e9

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


STATES = [
    HouseState(is_heard=True, guard=GuardNow(doing="idle"), arming=ArmingNow(mode="night")),
    HouseState(
        is_heard=True,
        guard=GuardNow(doing="driving", room_id=5, room_name="hall", origin="trigger"),
        arming=ArmingNow(mode="night"),
    ),
    HouseState(
        is_heard=True,
        guard=GuardNow(doing="looking", room_id=5, room_name="hall", origin="trigger", verdict="confirmed"),
        arming=ArmingNow(mode="night"),
    ),
    HouseState(
        is_heard=True,
        guard=GuardNow(doing="idle", last_verdict="confirmed"),
        arming=ArmingNow(mode="disarmed"),
        problems={"lidar": Problem(name="lidar", text="it is silent", is_error=True)},
    ),
    HouseState(is_stopped=True, guard=GuardNow(doing="idle"), arming=ArmingNow(mode="disarmed")),
]


def test_what_is_new_is_told_once(tmp_path: Path) -> None:
    log = DayLog(tmp_path / "console" / "day.jsonl", Clock())
    for state in STATES:
        log.follow(state)
        log.follow(state)
    english = words_of("en")
    assert [day_line(entry, english)[1] for entry in reversed(log.newest_first)] == [
        "The guard runs.",
        "Mode: Night",
        "To hall: its motion sensor called.",
        "hall: Somebody seen",
        "Mode: Disarmed",
        "it is silent",
        "The guard does not answer.",
        "The emergency stop is pressed.",
        "Well again: lidar",
    ]
    german = words_of("de")
    assert day_line(log.newest_first[-1], german)[1] == "Der W\u00e4chter l\u00e4uft."


def test_a_mission_that_saw_nobody_is_told_at_its_end(tmp_path: Path) -> None:
    log = DayLog(tmp_path / "day.jsonl", Clock())
    log.follow(HouseState(guard=GuardNow(doing="returning", room_name="hall")))
    log.follow(HouseState(guard=GuardNow(doing="idle", last_verdict="clear")))
    assert [(entry.what, entry.room) for entry in log.newest_first] == [("clear", "hall")]


def test_the_charger_is_told(tmp_path: Path) -> None:
    log = DayLog(tmp_path / "day.jsonl", Clock())
    for is_charging in (False, True, True, False):
        log.follow(HouseState(battery=BatteryNow(share=0.5, voltage=11.0, is_charging=is_charging)))
    assert [entry.what for entry in log.newest_first] == ["off", "on"]


def test_it_outlives_a_restart_and_a_cut_line_but_not_a_day(tmp_path: Path) -> None:
    path, clock = tmp_path / "day.jsonl", Clock()
    DayLog(path, clock).follow(STATES[0])
    with path.open("a") as file:
        file.write('{"wall": 18')
    again = DayLog(path, clock)
    assert [entry.kind for entry in again.newest_first] == ["mode", "guard"]
    clock.now += DAY
    assert again.newest_first == []


def test_the_file_does_not_grow_for_ever(tmp_path: Path) -> None:
    path, clock = tmp_path / "day.jsonl", Clock()
    log = DayLog(path, clock)
    for i in range(5000):
        log.follow(HouseState(is_stopped=bool(i % 2)))
    assert len(path.read_text().splitlines()) < 4100
    assert log.newest_first[0].kind == "stop"


def test_a_disk_that_refuses_costs_the_file_only(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    log = DayLog(tmp_path / "file" / "day.jsonl", Clock())
    log.follow(STATES[0])
    assert log.newest_first[0] == Entry(wall=log.newest_first[0].wall, kind="mode", what="night")
