"""A robot that is held up on its way to a room's point, or to a further viewpoint of it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from patrol_world import ROOMS

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalLink, GoalState, Progress, Standstill
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.mission.look_around import LookAround, LookParts
from rosbot_patrol.patrol.mission.phases import Arrived, DrivingTo
from rosbot_patrol.patrol.mission.views import OneTurn
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.records.mission import Mission
from rosbot_patrol.patrol.search.look import LookParams
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint

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


class OneView(OneTurn):
    """Asks for one further viewpoint, at x = 10, and for a turn there."""

    def __init__(self) -> None:
        super().__init__()
        self.views = [Viewpoint(pose=Pose2D(10.0, 0.0, 0.0), turn=1.0, gain=1.0, way=10.0)]

    def next(self, inputs: Inputs) -> Viewpoint | None:
        """The viewpoint, once."""
        return self.views.pop() if self.views else None


class Approach:
    """The way to that viewpoint, by a navigation that never ends it."""

    def __init__(self, *, is_up: bool = True) -> None:
        mission = Mission(id="m", room=ROOMS.base, views_done=[(0.0, 0.0, 0.0)])
        parts = LookParts(look=LookParams(), spin=SpinParams(), drive=DriveParams(held_after=5.0), needs_camera=False)
        self.look = LookAround(mission, OneView(), parts, Pose2D(0.0, 0.0, 0.0))
        self.is_up, self.now, self.tag = is_up, 100.0, ""
        assert self.run(0.1, 0.0) is None  # it chooses the viewpoint

    def run(self, seconds: float, x: float, speed: float = 0.0) -> float | None:
        """Time after which the goal was given up and the look began [s], None if it was not."""
        for k in range(round(10.0 * seconds)):
            link = GoalLink(is_up=self.is_up, tag=self.tag, state=GoalState.ACTIVE)
            pose = Pose2D(x, 0.0, 0.3 * k)  # it turns to and fro
            step = self.look.step(self.now, Inputs(pose=pose, yaw=0.3 * k, link=link), candidate=False)
            self.tag = step.goal.tag if step.goal else self.tag
            if step.cancel:
                assert not self.look.is_driving
                return k / 10.0
            self.now, x = self.now + 0.1, x + 0.1 * speed
        return None


def test_who_is_held_up_before_a_viewpoint_looks_from_there() -> None:
    approach = Approach()
    assert approach.run(30.0, 0.0, speed=0.3) is None  # longer than it may be held up, but it moves
    assert approach.run(8.0, 9.85) == pytest.approx(5.1, abs=0.2)


def test_what_others_do_with_the_wheels_is_no_standstill() -> None:
    approach = Approach()
    assert approach.run(4.0, 9.0) is None
    approach.look.pause()
    assert approach.run(4.0, 9.0) is None
    assert approach.run(4.0, 9.0) == pytest.approx(1.1, abs=0.2)


def test_a_navigation_that_is_down_is_waited_for() -> None:
    assert Approach(is_up=False).run(50.0, 9.0) is None


def test_a_standstill_ends_where_the_robot_leaves() -> None:
    standstill = Standstill()
    track = (10.0, 5.0), (12.0, 5.1), (14.0, 4.9), (15.0, 4.8), (17.0, 4.7)
    assert [standstill.lasts(now, Pose2D(x, 0.0, now)) for now, x in track] == [0.0, 2.0, 4.0, 0.0, 2.0]
