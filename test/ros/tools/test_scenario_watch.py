"""When a scenario is over, and what is said of it, on what topics say."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from std_msgs.msg import String

from rosbot_patrol.patrol.story.mission_story import AlertTelling, Narrator, Telling
from rosbot_patrol.ros.tools import narrated_scenario as scenario_watch
from rosbot_patrol.ros.tools.narrated_scenario import ScenarioWatch
from rosbot_patrol.simulation.scenario.file import PLAYED


class House:
    """A narrator and a watch that are fed by hand."""

    def __init__(self, text: str, folder: Path, patch: pytest.MonkeyPatch) -> None:
        file = folder / "play.yaml"
        file.write_text(text)
        self.now = 100.0
        self.told: list[str] = []
        patch.setattr(scenario_watch, "now", lambda: self.now)
        patch.setattr(scenario_watch.rospy, "Subscriber", lambda *_, **__: None)
        self.watch = ScenarioWatch(str(file), "/simulator", self.told.append)
        self.narrator = Narrator()

    def state(self, phase: str, why: str = "", mission: str = "", room: int = 0, verdict: str = "") -> None:
        told = Telling(phase=phase, why=why, mission=mission, room_id=room, last_verdict=verdict)
        self.narrator.state(self.now, told)

    def play(self, text: str = PLAYED) -> None:
        self.watch._on_act(String(text))

    def mission(self, name: str, room: int, verdict: str, why: str = "on guard, at home again") -> None:
        self.state("driving", mission=name, room=room)
        self.state("returning", mission=name, room=room)
        if verdict == "confirmed":
            self.narrator.alert(
                AlertTelling(
                    id=name, room=f"room {room}", object_class="person", probability=0.9, delivered=True,
                    transport="maildir", location="/mail",
                )
            )  # fmt: skip
        self.state("idle", why, verdict=verdict)

    @property
    def is_over(self) -> bool:
        return self.watch.is_over(self.narrator)


def test_it_is_over_when_everything_has_happened_and_each_room_has_its_verdict(tmp_path, monkeypatch) -> None:
    house = House("expect: {verdicts: {5: confirmed, 3: clear}, mails: 1}", tmp_path, monkeypatch)
    assert not house.is_over
    house.state("idle", "on guard")
    house.mission("a", 5, "confirmed")
    assert not house.is_over
    house.mission("b", 3, "clear")
    assert not house.is_over  # not everything has happened
    house.play("bob appears")
    house.play()
    assert house.told == ["Bob appears.", PLAYED]
    assert house.is_over
    assert house.watch.failures(house.narrator) == []


def test_what_disappoints_is_said(tmp_path, monkeypatch) -> None:
    house = House("expect: {verdicts: {5: confirmed}, mails: 1}", tmp_path, monkeypatch)
    house.state("idle", "on guard")
    house.play()
    house.mission("a", 5, "clear", "not at home")
    assert house.is_over
    assert house.watch.failures(house.narrator) == [
        "The verdict for room 5 should have been confirmed; it was clear.",
        "1 mail should have been written; there were 0.",
        "The robot should have been home.",
    ]


def test_its_time_passes_on_the_simulated_clock(tmp_path, monkeypatch) -> None:
    house = House("expect: {verdicts: {5: clear}, within: 60}", tmp_path, monkeypatch)
    house.state("idle", "on guard")
    assert not house.is_over
    house.now += 61.0
    assert house.is_over
    assert house.watch.failures(house.narrator) == [
        "The verdict for room 5 should have been clear; no mission to it has ended.",
        "Not everything in the scenario has happened: an event that it waits for did not come.",
        "Its time of 60 simulated seconds has passed.",
    ]


def test_no_mission_at_all_may_be_what_is_expected(tmp_path, monkeypatch) -> None:
    house = House("expect: {missions: 0, within: 30}", tmp_path, monkeypatch)
    house.state("idle", "on guard")
    house.play()
    assert not house.is_over
    house.now += 31.0
    assert house.is_over
    assert house.watch.failures(house.narrator) == []
