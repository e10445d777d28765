import dataclasses

import pytest

from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.records.commands import Commands, Ignored, IntruderAlarm, Report
from rosbot_patrol.patrol.records.findings import Confirmation
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.story.mission_log import MissionLog

WALL = 1_790_000_000.0


class Patrol:
    """Steps a chronicle once a second."""

    def __init__(self):
        self.mission_log, self.now = MissionLog(), 100.0

    def step(self, mission=None, report=None, heard=(), pose=None, **commands):
        self.now += 1.0
        commands = Commands(report=report, **commands)
        wall = WALL + self.now
        return self.mission_log.step(
            now=self.now, wall=wall, mission=mission, commands=commands, pose=pose, heard=heard
        )


@pytest.fixture
def patrol():
    return Patrol()


def mission(**given):
    room = Room(id=3, name="hall", pose=Pose2D(1.0, 2.0, 0.0))
    return Mission(id="m1", room=room, wall=WALL + 101.0, **given)


def said(phase, why, mission="m1"):
    return Report(phase=phase, why=why, mission=mission)


def heard(seconds, text="motion sensor 3 sees motion"):
    return Event(wall=WALL + seconds, kind="sensor", text=text)


def test_between_missions_there_is_nothing_to_write(patrol):
    assert patrol.step(report=said(Phase.IDLE, "on guard", ""), heard=[heard(101)]) == []


def test_a_mission_begins_with_what_its_sensors_said_before(patrol):
    patrol.step(heard=[heard(20.0, "long ago")])
    patrol.step(heard=[heard(100.0)])
    begin, state = patrol.step(mission(), said(Phase.DRIVING, "driving to room 3"))
    assert begin.begin.id == "m1"
    assert (begin.begin.room_id, begin.begin.room_name, begin.begin.origin) == (3, "hall", "trigger")
    assert [event.text for event in begin.begin.events] == ["motion sensor 3 sees motion"]
    assert state.times == (("driving", WALL + 103.0),)
    assert state.events[0].text == "driving to room 3"
    assert patrol.step(mission()) == []


def test_phases_sensors_and_the_way_are_told_once(patrol):
    patrol.step(mission(), said(Phase.DRIVING, "driving"), pose=Pose2D(0.0, 0.0, 0.0))
    for i in range(1, 5):
        assert patrol.step(mission(), pose=Pose2D(0.1 * i, 0.0, 0.0)) == []
    (entry,) = patrol.step(mission(), heard=[heard(107.0)])
    assert entry.events[0].kind == "sensor"
    (entry,) = patrol.step(mission(phase=Phase.LOOKING), said(Phase.LOOKING, "arrived"))
    assert entry.times[0][0] == "looking"
    assert entry.path == ((0.2, 0.0), (0.4, 0.0))  # the first point came with the first phase


def test_a_sentence_that_changes_all_the_time_is_not_written_all_the_time(patrol):
    patrol.step(mission(), said(Phase.LOOKING, "turning"))
    count = sum(len(patrol.step(mission(), said(Phase.LOOKING, f"turning, {i} degrees"))) for i in range(10))
    assert count == 5


def test_somebody_seen_then_the_verdict_then_the_end(patrol):
    patrol.step(mission(), said(Phase.LOOKING, "turning"))
    found = mission(verdict=Verdict.CONFIRMED, reason="a person", sightings=1, place=(3.0, 4.0), share_seen=0.5)
    seen = Confirmation(label="person", probability=0.9, stamp=101.5, boxes=(), pictures=3)
    alarm = IntruderAlarm(
        mission=dataclasses.replace(found), seen=seen, phase=Phase.LOOKING, pose=Pose2D(1.0, 2.0, 0.5)
    )
    verdict, sighting = patrol.step(found, alarms=(alarm,))
    assert verdict.changes["verdict"] == "confirmed"
    assert verdict.events[0].text == "confirmed: a person"
    assert sighting.changes["object_class"] == "person"
    assert sighting.changes["person"] == (3.0, 4.0)
    assert sighting.changes["pose"] == (1.0, 2.0, 0.5)
    assert sighting.changes["confirmed"] == WALL + 102.0
    (end,) = patrol.step(None, said(Phase.IDLE, "at home again", ""), ended=(found,))
    assert end.closed == WALL + 103.0
    assert end.changes["share_seen"] == 0.5
    assert patrol.step(None) == []


def test_a_mission_that_was_over_before_it_began_has_a_record(patrol):
    running = mission()
    patrol.step(running, said(Phase.DRIVING, "driving"))
    other = dataclasses.replace(mission(verdict=Verdict.UNVERIFIED, reason="too old"), id="m0")
    begin, end = patrol.step(running, ended=(other,))
    assert (begin.begin.id, end.incident, end.changes["reason"]) == ("m0", "m0", "too old")
    assert patrol.step(running) == []  # the one that runs goes on


def test_calls_that_are_not_followed_are_on_record(patrol):
    patrol.step(mission(), said(Phase.DRIVING, "driving"))
    ignored = (
        Ignored(wall=WALL, room_id=2, why="its own motion", mission="m1"),
        Ignored(wall=WALL, room_id=2, why="x"),
    )
    (entry,) = patrol.step(mission(), ignored=ignored)
    assert entry.events[0].text == "its own motion"
