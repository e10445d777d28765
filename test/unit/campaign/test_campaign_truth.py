"""The truth of a patrol by hand-made tracks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.campaign.cast import Person
from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.share import true_share
from rosbot_patrol.campaign.truth import Track, place_error, presence, shown, touches
from rosbot_patrol.geometry import Pose2D

ROOM, POINT = 1, (3.10, 3.15)  # the flat's living room
PLACE = (4.3, 3.15)
BOB = Person(name="bob")


def still(x: float, y: float, yaw: float = 0.0, end: float = 10.0) -> Track:
    times = list(np.arange(0.0, end, 0.2))
    return Track(times, [Pose2D(x, y, yaw)] * len(times))


@pytest.mark.parametrize(("yaw", "seen"), [(0.0, 10.0), (math.pi, 0.0), (0.4, 10.0), (0.7, 0.0)])
def test_who_stands_before_the_camera_is_in_view(flat_floor: Floor, yaw: float, seen: float) -> None:
    found = presence(flat_floor, ROOM, [BOB], {"bob": still(*PLACE)}, still(*POINT, yaw), begin=0.0, end=10.0)
    assert found.in_view == pytest.approx(seen, abs=0.3)
    assert found.in_room == pytest.approx(10.0, abs=0.3)
    assert found.first_view == (0.0 if seen else None)
    assert found.was_there


def test_who_comes_after_the_verdict_was_not_there(flat_floor: Floor) -> None:
    late = Track([8.0, 8.2, 8.4], [Pose2D(*PLACE, 0.0)] * 3)
    assert not presence(flat_floor, ROOM, [BOB], {"bob": late}, still(*POINT), begin=0.0, end=7.0).was_there
    assert not presence(flat_floor, ROOM, [BOB], {"bob": late}, still(*POINT, math.pi), begin=0.0, end=10.0).was_there


def test_a_wall_hides(flat_floor: Floor) -> None:
    bath = (-2.25, 0.15)
    towards = math.atan2(PLACE[1] - bath[1], PLACE[0] - bath[0])
    found = presence(flat_floor, ROOM, [BOB], {"bob": still(*PLACE)}, still(*bath, towards), begin=0.0, end=10.0)
    assert found.in_view == 0.0


def test_people_are_counted_whom_the_camera_had_in_view_for_long_enough(flat_floor: Floor) -> None:
    people = [BOB, Person(name="eve"), Person(name="away")]
    short = Track([1.0, 1.2, 1.4], [Pose2D(*PLACE, 0.0)] * 3)
    beside = still(PLACE[0], PLACE[1] + 0.5)
    ahead = still(*POINT)
    assert shown(flat_floor, people, {"bob": still(*PLACE), "eve": beside}, ahead, begin=0.0, end=10.0) == 2
    assert shown(flat_floor, people, {"bob": still(*PLACE), "eve": short}, ahead, begin=0.0, end=10.0) == 1
    assert shown(flat_floor, people, {"bob": still(*PLACE)}, ahead, begin=0.0, end=1.0) == 0


def test_a_dog_does_not_count(flat_floor: Floor) -> None:
    assert not presence(flat_floor, ROOM, [], {"rex": still(*PLACE)}, still(*POINT), begin=0.0, end=10.0).was_there


def test_the_place_that_was_told_is_held_against_the_nearest() -> None:
    tracks = {"a": still(1.0, 1.0), "b": still(4.0, 1.0)}
    assert place_error(tracks, [Person(name="a"), Person(name="b")], 5.0, 4.0, 1.3) == pytest.approx(0.3)
    assert place_error(tracks, [], 5.0, 4.0, 1.3) is None


def test_a_touch_is_told_once_with_who_moved_and_who_turned() -> None:
    times = list(np.arange(0.0, 5.0, 0.1))
    robot = Track(times, [Pose2D(0.3 * time, 0.0, 0.0) for time in times])
    dog = Track(times, [Pose2D(1.0, 0.2, 2.0 * time) for time in times])
    contacts = [(2.0, "rex"), (2.1, "rex"), (2.2, "sofa"), (4.0, "rex")]
    first, sofa, again = touches(contacts, robot, {"rex": dog})
    assert first == "rex at 2.0 s, the robot at (0.60, 0.00), at 0.30 m/s, rex at 0.00 m/s and turning at 2.0 rad/s"
    assert sofa == "sofa at 2.2 s, the robot at (0.66, 0.00), at 0.30 m/s"
    assert again.startswith("rex at 4.0 s")


def test_a_full_turn_shows_the_room_but_what_furniture_hides(flat_floor: Floor) -> None:
    times = list(np.arange(0.0, 10.0, 0.05))
    turn = Track(times, [Pose2D(*POINT, 0.63 * time) for time in times])
    glance = Track(times, [Pose2D(*POINT, 0.0)] * len(times))
    assert 0.80 < true_share(flat_floor, ROOM, turn, 0.0, 10.0) <= 1.0
    assert 0.05 < true_share(flat_floor, ROOM, glance, 0.0, 10.0) < 0.5
    assert true_share(flat_floor, ROOM, glance, 0.0, 0.1) < 0.05
