"""Rooms with a point off the map's floor: refused by name, told to the owner, and the others go on."""

from __future__ import annotations

import pytest
from floors import points
from room_world import POINT, World

from rosbot_patrol.patrol.records.mission import Verdict
from rosbot_patrol.patrol.records.request import Origin, Request

HOME = (2.0, 4.7)
OFF = {"outside": (40.0, 3.0), "in a wall": (3.0, 3.5), "beyond the wall": (12.3, 4.0)}


def world_with(*places: tuple[float, float]) -> World:
    return World(rooms=points(*places))


@pytest.mark.parametrize("where", OFF)
def test_a_room_off_the_map_is_unverified_without_a_drive_and_told(where: str) -> None:
    world = world_with(HOME, OFF[where], POINT[:2])
    mission = world.mission(1)
    assert mission.verdict is Verdict.UNVERIFIED
    assert mission.share_seen is None
    assert "room 1 (room 1) was not looked at: its point" in mission.reason
    assert "is not on free floor of the map; correct rooms/room1" in mission.reason
    assert all((goal.x, goal.y) == HOME for goal in world.goals)
    (word,) = world.words
    assert word.text.startswith("motion in room 1 (room 1), which cannot be looked at: its point")
    other = world.mission_after(2)
    assert other.verdict is Verdict.CLEAR
    assert other.share_seen > 0.9


def test_a_sensor_that_goes_on_calling_makes_no_flood_of_missions() -> None:
    world = world_with(HOME, OFF["outside"], POINT[:2])
    for _ in range(300):
        world.triggers = (1,)
        world.step()
    assert len(world.ended) == len(world.words) == 1
    assert "not on the map's floor" in world.ignored[-1].why


@pytest.mark.parametrize("origin", [Origin.SCHEDULE, Origin.ACTION, Origin.ALL])
def test_a_round_tells_each_time_and_the_others_go_on(origin: Origin) -> None:
    world = world_with(HOME, OFF["in a wall"], POINT[:2])
    for _ in range(2):
        count = len(world.ended)
        world.manager.ask([Request(room_id=room, origin=origin, wall=1.7e9) for room in (1, 2)])
        world.until(lambda w, wanted=count + 2: len(w.ended) >= wanted)
    assert [m.verdict for m in world.ended] == [Verdict.UNVERIFIED, Verdict.CLEAR] * 2
    assert world.words == []


def test_a_map_that_comes_during_the_drive_ends_it() -> None:
    world = world_with(HOME, OFF["beyond the wall"])
    house, world.house = world.house, None
    world.triggers = (1,)
    world.until(lambda w: bool(w.goals))
    world.house = house
    world.until(lambda w: bool(w.ended))
    assert world.ended[0].verdict is Verdict.UNVERIFIED
    assert world.cancels
    assert (world.goals[-1].x, world.goals[-1].y) == HOME


@pytest.mark.parametrize("where", OFF)
def test_with_the_base_off_the_map_rooms_are_guarded_and_the_robot_stays_there(where: str) -> None:
    world = world_with(OFF[where], POINT[:2])
    mission = world.mission(1)
    assert mission.verdict is Verdict.CLEAR
    assert all(goal[:2] != OFF[where] for goal in world.goals)
    assert "not at home (room 0 (room 0): its point" in world.reports[-1].why
    assert "the robot drives home" in world.manager.go_home()
    for _ in range(5):
        world.step()
    assert "not at home" in world.reports[-1].why
    assert all(goal[:2] != OFF[where] for goal in world.goals)
