"""A robot that is held up on its way to a room's point."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from patrol_world import ROOMS

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink, GoalState, Progress
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.mission.phases import Arrived, DrivingTo
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission

HOUSE = SimpleNamespace(room_at=lambda x, y: round(x / 10.0))  # rooms of 10 m about their points


class Way:
    """A drive to room 2 at x = 20 by a navigation that never ends it."""

    def __init__(self, house: object = HOUSE) -> None:
        room = next(room for room in ROOMS if room.id == 2)
        self.drive = DrivingTo(Mission(id="m", room=room), DriveParams(held_after=5.0), None)
        self.house, self.now, self.tag = house, 100.0, ""

    def run(self, seconds: float, x: float, speed: float = 0.0) -> object:
        """The outcome within some seconds, and whether the goal was given up."""
        for _ in range(round(10.0 * seconds)):
            link = GoalLink(is_up=True, tag=self.tag, state=GoalState.ACTIVE)
            step = self.drive.step(self.now, Inputs(pose=Pose2D(x, 0.0, 0.0), house=self.house, link=link))
            self.tag = step.goal.tag if step.goal else self.tag
            if step.outcome is not None:
                assert step.cancel
                return step.outcome
            self.now, x = self.now + 0.1, x + 0.1 * speed
        return None


def test_who_is_held_up_in_the_room_looks_from_there() -> None:
    way = Way()
    assert way.run(60.0, 12.0) is None  # in the room before
    assert way.run(10.0, 15.5, speed=0.3) is None  # it comes nearer
    assert isinstance(way.run(5.5, 18.5), Arrived)


@pytest.mark.parametrize("house", [None, SimpleNamespace(room_at=lambda x, y: 7)])
def test_elsewhere_it_goes_on_trying(house: object) -> None:
    assert Way(house).run(60.0, 18.5) is None


def test_what_others_do_with_the_wheels_is_no_delay() -> None:
    way = Way()
    assert way.run(4.0, 18.5) is None
    way.drive.hold(way.now, Inputs())
    way.now += 30.0
    assert way.run(4.0, 18.5) is None
    way.drive.pause()
    assert way.run(4.0, 18.5) is None
    assert isinstance(way.run(2.0, 18.5), Arrived)


def test_progress_is_a_step_nearer() -> None:
    progress = Progress()
    track = (10.0, 5.0), (12.0, 4.9), (14.0, 4.8), (15.0, 4.75), (17.0, 6.0)
    assert [progress.stalled(now, gap) for now, gap in track] == [0.0, 2.0, 0.0, 1.0, 3.0]
