"""The sentences that the patrol writes are read back as what it does."""

from __future__ import annotations

import pytest
from patrol_world import World, looking

from rosbot_patrol.goal import GoalLink
from rosbot_patrol.patrol.records.activity import (
    Activity,
    Place,
    Whereabouts,
    activity_of,
    is_away,
    is_full_turn,
    turning,
)


def test_a_turn_is_read_back() -> None:
    assert activity_of(f"{turning(95.0, 360.0)}, in room 1 (hall)") is Activity.TURNING
    assert is_full_turn(turning(95.0, 360.0))
    assert not is_full_turn(turning(95.0, 180.0))


@pytest.mark.parametrize("kind", Whereabouts)
def test_only_a_robot_that_is_not_home_is_away(kind: Whereabouts) -> None:
    assert is_away(f"on guard, {Place(kind, ' (blocked)').text}; clear: nobody") == (kind is Whereabouts.AWAY)


def test_a_reason_with_the_words_of_an_activity_is_none() -> None:
    assert activity_of("driving home, clear: nobody seen in room 1 (waiting room)") is Activity.OTHER


def test_a_mission_tells_what_it_does() -> None:
    world = World(person_when=lambda w: looking(w) and w.yaw > 1.0)
    world.triggers = [1]
    world.run(lambda w: w.x > 4.0)
    world.link = GoalLink(is_up=False)
    world.run(lambda w: activity_of(w.reports[-1].why) is Activity.WAITING_FOR_NAVIGATION)
    world.link, world.detector = GoalLink(is_up=True), False
    world.run(lambda w: activity_of(w.reports[-1].why) is Activity.WAITING_TO_TURN)
    world.detector = True
    world.run(lambda w: w.ended)
    told = [activity_of(report.why) for report in world.reports]
    assert told.index(Activity.TURNING) < told.index(Activity.WAITING_FOR_PICTURES)
    assert not is_away(world.reports[-1].why)
