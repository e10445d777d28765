"""What of a mission goes on after a restart, and with what."""

from __future__ import annotations

import dataclasses

from room_world import World

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.mission.resume import Memory, memory_from_plain, memory_to_plain
from rosbot_patrol.patrol.records.inputs import Battery
from rosbot_patrol.patrol.records.mission import Mission, Phase
from rosbot_patrol.patrol.records.request import Request

ROOMS = Rooms(tuple(Room(id=i, name=f"name{i}", pose=Pose2D(float(i), 0.0, 0.0)) for i in range(3)))
PERSON = 6.0, 2.5  # in view on the way home, too


def test_a_memory_survives_the_round_trip() -> None:
    memory = Memory(
        count=3,
        waiting=(Request(room_id=2, id="b"),),
        mission=Mission(id="a", room=ROOMS.get(1), phase=Phase.RETURNING),
        last_verdict="clear",
        held={"a": 5.0},
    )
    assert memory_from_plain(memory_to_plain(memory), ROOMS) == memory


def test_a_recalled_mission_that_a_low_battery_ends_at_once_knows_whom_it_met() -> None:
    before = World(lambda now: [PERSON])
    before.triggers = (1,)
    before.until(lambda w: bool(w.notices) and w.phase is Phase.LOOKING)
    world = World(lambda now: [PERSON], memory=before.manager.snapshot())
    world.pose, step = before.pose, world.manager.step
    world.manager.step = lambda now, inputs: step(now, dataclasses.replace(inputs, battery=Battery(share=0.1, at=now)))
    mission = world.until(lambda w: bool(w.ended)).ended[0]
    assert mission.sightings > before.manager.mission.sightings  # they are seen again on the way home
    assert world.notices == []


def test_what_looked_like_somebody_is_told_once_with_the_mission_that_saw_it() -> None:
    world = World(lambda now: [(7.0, 1.0)])
    world.score = lambda pose: 0.45  # too weak to confirm
    world.triggers = (1,)
    world.until(lambda w: w.phase is Phase.LOOKING and w.pose.yaw < -1.5)
    world.triggers = (0,)
    world.step()
    ended = world.manager.abandon("the end")
    assert [mission.room.id for mission in ended.ended] == [0, 1]
    assert len(ended.suspects) == 1
