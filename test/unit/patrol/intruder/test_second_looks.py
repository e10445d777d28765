"""Places that are worth another look: what was too near comes along, goes, and is told."""

import math

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.close_ups import SeenAt
from rosbot_patrol.patrol.intruder.second_looks import SecondLooks
from rosbot_patrol.patrol.intruder.weak_sightings import WeakSighting, WeakSightings
from rosbot_patrol.patrol.records.inputs import Box, Eye, Measured
from rosbot_patrol.patrol.visibility.coverage import Sight

SEEN_IN = 3
ALL_AROUND = Sight(x=3.0, y=0.0, first=-math.pi, step=math.tau / 360.0, lengths=np.full(360, 5.0))


def near(x: float, y: float, at: float = 0.0) -> SeenAt:
    return SeenAt(x, y, at)


def test_what_was_too_near_wants_one_look():
    doubts = SecondLooks(SEEN_IN)
    doubts.set_too_near([near(1.0, 0.0)])
    (doubt,) = doubts.open()
    assert doubt.spans == ({"nearest": 2.0, "most": 4.5},)
    doubt.visit(Pose2D(0.0, 0.0, 0.0))
    doubts.set_too_near([near(1.2, 0.1)])
    assert doubts.open() == [doubt]  # which it has not had yet
    for _ in range(SEEN_IN):
        doubts.look(None, Eye(pose=Pose2D(3.0, 0.0, math.pi), width=1.0), ALL_AROUND)
    assert doubts.open() == []


def test_what_was_too_near_and_came_along_is_looked_at_again_but_not_for_ever():
    doubts = SecondLooks(SEEN_IN)
    doubts.set_too_near([near(0.0, 0.0)])
    visits = 0
    for k in range(10):
        for doubt in doubts.open():
            doubt.visit(Pose2D(0.0, 0.0, 0.0))
            visits += 1
        doubts.set_too_near([near(0.9 * ((k + 1) % 2), 0.0, at=float(k))])
    assert visits == 3


def test_a_look_counts_for_the_place_it_showed_only():
    doubts = SecondLooks(SEEN_IN)
    doubts.set_too_near([near(0.0, 0.0)])
    doubts.open()[0].visit(Pose2D(0.0, 0.0, 0.0))
    for _ in range(SEEN_IN):
        doubts.look(None, Eye(pose=Pose2D(3.0, 0.0, math.pi), width=1.0), ALL_AROUND)
    assert doubts.unsure(is_moving=False) == ""
    doubts.set_too_near([near(0.0, 1.0)])
    assert "(0.0, 1.0) was too near to be told from a pet" in doubts.unsure(is_moving=False)
    assert [(d.x, d.y) for d in doubts.open()] == [(0.0, 1.0)]


def suspects(*eyes: Pose2D, score: float = 0.6) -> list[WeakSighting]:
    """Something at (0, 0) that looks more or less like a person from some places for long."""
    measured = Measured(x=0.0, y=0.0, error=0.2, away=3.0, top=1.0, height=0.7, width=0.5)
    box = Box(label="person", probability=score, xmin=100, ymin=50, xmax=200, ymax=250, measured=measured)
    seen, now = WeakSightings(), 1.0
    for eye in eyes:
        for _ in range(9):
            now += 0.1
            seen.add(now, eye, (box,))
    return seen.doubtful()


@pytest.mark.parametrize(
    ("eye", "is_told"),
    [
        (Pose2D(3.0, 0.0, math.pi), False),  # the same side
        (Pose2D(3.0, 0.0, 0.0), False),
        (Pose2D(1.5, 0.0, math.pi), True),  # much nearer
        (Pose2D(0.0, 3.0, -math.pi / 2.0), True),
        (Pose2D(0.0, 3.0, 0.0), False),  # looks elsewhere
        (Pose2D(0.0, 7.0, -math.pi / 2.0), False),  # the wall in between
    ],
)
def test_one_side_is_not_all_until_pictures_of_another_showed_the_place(eye: Pose2D, is_told: bool) -> None:
    doubts, way = SecondLooks(SEEN_IN), Pose2D(0.0, 2.0, 0.0)
    sight = Sight(x=eye.x, y=eye.y, first=-math.pi, step=math.tau / 360.0, lengths=np.full(360, 5.0))
    doubts.suspect(suspects(Pose2D(3.0, 0.0, math.pi)))
    for visit in range(4):
        (doubt,) = doubts.open()
        assert doubts.grave() == [doubt]
        doubt.visit(way)
        assert len(doubt.tried) == visit + 1
        if visit == 1:
            for _ in range(5):
                doubts.look(None, Eye(pose=eye, width=1.0), sight)
            if is_told:
                break
    assert doubts.open() == []
    assert [d.text for d in doubts.grave()] == ([] if is_told else [doubt.text])
    doubts.suspect([])  # somebody was confirmed there
    assert doubts.grave() == []


@pytest.mark.parametrize(("seen", "empty", "is_told"), [(9, 5, False), (9, 9, True), (3, 5, True), (0, 5, True)])
def test_a_second_look_that_shows_somebody_again_tells_nothing(seen: int, empty: int, is_told: bool) -> None:
    doubts, first, second = SecondLooks(SEEN_IN), Pose2D(3.0, 0.0, math.pi), Pose2D(1.5, 0.0, math.pi)
    doubts.suspect(suspects(first))
    (doubt,) = doubts.open()
    doubt.visit(second)
    (suspect,) = suspects(first)
    for k in range(seen + empty):
        stamp = 10.0 + 0.1 * k
        suspect.seen_at = stamp if k < seen else suspect.seen_at
        doubts.suspect([suspect])
        doubts.look(stamp, Eye(pose=second, width=1.0), ALL_AROUND)
    assert (doubts.grave() == []) == is_told


def test_what_looks_little_like_a_person_gets_two_looks_at_most_and_is_not_grave() -> None:
    doubts = SecondLooks(SEEN_IN)
    doubts.suspect(suspects(Pose2D(3.0, 0.0, math.pi), score=0.45))
    for _ in range(2):
        (doubt,) = doubts.open()
        doubt.visit(Pose2D(0.0, 2.0, 0.0))
    assert doubts.open() == []
    assert doubts.grave() == []


def looked_at() -> SecondLooks:
    """Something too near was at (0, 0), whose place was seen from farther off since."""
    doubts = SecondLooks(SEEN_IN)
    doubts.set_too_near([near(0.0, 0.0)])
    doubts.open()[0].visit(Pose2D(3.0, 0.0, math.pi))
    for _ in range(SEEN_IN):
        doubts.look(None, Eye(pose=Pose2D(3.0, 0.0, math.pi), width=1.0), ALL_AROUND)
    assert doubts.open() == []
    return doubts


def test_what_moves_is_looked_at_for_what_was_too_near_and_has_gone():
    doubts = looked_at()
    doubts.follow([(9.0, 0.0), (1.0, 2.0)])
    doubts.set_too_near([near(0.0, 0.0)])
    (doubt,) = doubts.open()
    assert (doubt.x, doubt.y) == (1.0, 2.0)
    assert "(0.0, 0.0) was too near to be told from a pet" in doubts.unsure(is_moving=True)
    doubts.set_too_near([])  # it was told: a pet
    assert doubts.open() == []
    assert doubts.unsure(is_moving=True) == ""


def test_what_moves_is_not_followed_for_ever():
    doubts = looked_at()
    visits = 1
    for k in range(10):
        doubts.follow([(float(k % 2), 2.0)])
        for doubt in doubts.open():
            doubt.visit(Pose2D(3.0, 0.0, math.pi))
            visits += 1
            doubt.looks = SEEN_IN
        doubts.set_too_near([near(0.0, 0.0)])
    assert visits == 3


@pytest.mark.parametrize("place", [(0.3, 0.2), (9.0, 0.0)])
def test_what_moves_where_it_was_seen_or_far_away_is_not_followed(place: tuple[float, float]):
    doubts = looked_at()
    doubts.follow([place])
    assert doubts.open() == []


def test_where_something_moves_what_was_too_near_may_have_gone():
    doubts = SecondLooks(SEEN_IN)
    doubts.set_too_near([near(0.0, 0.0)])
    for _ in range(SEEN_IN):
        doubts.look(None, Eye(pose=Pose2D(3.0, 0.0, math.pi), width=1.0), ALL_AROUND)
    assert doubts.unsure(is_moving=True)
    doubts.set_too_near([])
    assert doubts.unsure(is_moving=True) == ""
    assert doubts.open() == []


def test_what_was_seen_far_off_takes_some_pictures():
    doubts = SecondLooks(SEEN_IN)
    for k in range(SEEN_IN):
        assert doubts.open() == []
        doubts.add_far("fire hydrant", 6.0 + 0.1 * k, 0.0)
    assert len(doubts.open()) == 1
    assert doubts.open()[0].text == "something like a fire hydrant at about (6.0, 0.0) was not seen from near"
