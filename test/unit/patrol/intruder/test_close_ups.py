"""What is too near to be told from a pet."""

from __future__ import annotations

import dataclasses

import pytest
from floors import drawn_floor

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.close_ups import CloseUps
from rosbot_patrol.patrol.intruder.exclusions import Exclusions
from rosbot_patrol.patrol.records.inputs import Box, Eye, Measured


def box(
    x: float = 0.0, *, top: float = 0.7, cut: bool = True, label: str = "person", score: float = 0.9, **fields
) -> Box:
    defaults = {"x": x, "y": 0.0, "error": 0.1, "away": 1.2, "top": top, "height": top, "width": 0.4, "is_cut": cut}
    measured = Measured(**{**defaults, **fields})
    return Box(label=label, probability=score, xmin=100, ymin=0 if cut else 90, xmax=200, ymax=300, measured=measured)


PERSON, PET = {"top": 1.6, "cut": False}, {"top": 0.6, "cut": False}


@pytest.fixture
def close_ups() -> CloseUps:
    return CloseUps(Exclusions())


def test_legs_alone_are_a_doubt(close_ups: CloseUps) -> None:
    assert close_ups.sort(1.0, (box(),)) == ((), True)
    assert [(s.x, s.y) for s in close_ups.doubtful] == [(0.0, 0.0)]
    close_ups.sort(1.1, (box(0.1),))
    assert len(close_ups.doubtful) == 1
    close_ups.start()
    assert not close_ups.doubtful


def test_a_box_that_begins_a_little_below_the_pictures_edge_is_of_legs_too(close_ups: CloseUps) -> None:
    begun = dataclasses.replace(box(), ymin=14)
    assert close_ups.sort(1.0, (begun,)) == ((), True)
    assert not close_ups.sort(1.1, (dataclasses.replace(begun, ymin=16),))[1]  # a pet's back


def test_a_low_part_at_the_pictures_edge_is_a_doubt_and_no_pet(close_ups: CloseUps) -> None:
    part = box(top=0.6, cut=False, is_cut_aside=True)
    assert close_ups.sort(1.0, (part,)) == ((), True)
    assert close_ups.sort(1.1, (box(),)) == ((), True)  # not taken for that pet's legs
    assert close_ups.doubtful


def test_a_part_at_the_pictures_edge_tells_no_better_place_than_the_whole_shortly_before(close_ups: CloseUps) -> None:
    def places() -> list[float]:
        return [s.x for s in close_ups.doubtful]

    close_ups.sort(1.0, (box(0.0),))
    close_ups.sort(1.5, (box(0.6, is_cut_aside=True),))
    assert places() == [0.0]
    close_ups.sort(2.0, (box(0.7),))
    assert places() == [0.7]
    close_ups.sort(6.0, (box(0.2, is_cut_aside=True),))  # long after: it may have walked
    assert places() == [0.2]


@pytest.mark.parametrize(("score", "later", "x"), [(0.3, 1.0, 0.0), (0.3, 5.0, 0.6), (0.8, 1.0, 0.6)])
def test_an_unsure_sighting_tells_no_better_place_than_a_sure_one_shortly_before(
    close_ups: CloseUps, score: float, later: float, x: float
) -> None:
    close_ups.sort(1.0, (box(score=0.9),))
    close_ups.sort(1.0 + later, (box(0.6, score=score),))
    assert [s.x for s in close_ups.doubtful] == [x]


def test_what_is_measured_beyond_a_wall_stands_before_it() -> None:
    floor = drawn_floor("#######", "#.....#", "#.....#", "#######", "#.....#", "#######")  # 0.5 m a cell
    close_ups, eye = CloseUps(Exclusions(floor=floor)), Eye(pose=Pose2D(1.0, 1.7, 1.57), width=1.0)
    for y, seen in ((1.9, 1.9), (2.7, 2.45), (3.35, 3.35)):  # the last is too far beyond to be a poor measurement
        close_ups.start()
        close_ups.sort(1.0, (box(1.0, y=y),), eye)
        ((x, there),) = [(s.x, s.y) for s in close_ups.doubtful]
        assert x == pytest.approx(1.0)
        assert there == pytest.approx(seen, abs=0.11)


@pytest.mark.parametrize(
    "given",
    [
        box(**PERSON),
        box(top=1.1),  # the picture ends above a pet
        box(width=1.4),  # as wide as one who lies
        box(label="fire hydrant"),
        box(source="floor", error=0.5),
        Box(label="person", probability=0.9, xmin=0, ymin=0, xmax=50, ymax=90),
    ],
)
def test_what_can_be_judged_is_left_to_the_judge(close_ups: CloseUps, given: Box) -> None:
    assert close_ups.sort(1.0, (given,)) == ((given,), False)
    assert not close_ups.doubtful


def test_legs_of_somebody_who_was_seen_whole_are_theirs(close_ups: CloseUps) -> None:
    legs = box(0.0)
    for k in range(2):
        close_ups.sort(1.0 + 0.1 * k, (box(2.0, **PERSON),))
    assert close_ups.sort(1.3, (legs,)) == ((), True)  # not often enough
    close_ups.sort(1.4, (box(2.0, **PERSON),))
    assert close_ups.sort(3.0, (legs,)) == ((legs,), False)
    assert close_ups.sort(3.1, (box(-9.0),)) == ((), True)  # nobody walks that fast


@pytest.mark.parametrize(("top", "is_person"), [(0.95, True), (0.85, False)])
def test_what_goes_on_higher_up_than_any_pet_speaks_for_what_is_below(
    close_ups: CloseUps, top: float, is_person: bool
) -> None:
    for k in range(3):
        close_ups.sort(1.0 + 0.1 * k, (box(0.3, top=top),))
    assert close_ups.sort(1.4, (box(),))[1] != is_person


@pytest.mark.parametrize("given", [box(2.0, top=1.6, cut=False, score=0.5), box(2.0, top=0.95, cut=False)])
def test_a_dog_far_off_that_passes_for_a_person_does_not_speak_for_its_legs(close_ups: CloseUps, given: Box) -> None:
    for k in range(20):
        close_ups.sort(1.0 + 0.1 * k, (given,))
    assert close_ups.sort(3.0, (box(),)) == ((), True)


def test_legs_of_a_pet_are_the_pets_whenever_it_is_seen_whole(close_ups: CloseUps) -> None:
    close_ups.sort(1.0, (box(),))
    assert close_ups.doubtful
    close_ups.sort(3.0, (box(1.5, **PET),))
    assert not close_ups.doubtful
    assert close_ups.sort(4.0, (box(1.0),)) == ((), False)
    assert not close_ups.doubtful


def test_a_persons_legs_are_theirs_and_those_that_follow_too(close_ups: CloseUps) -> None:
    legs = box(has_legs=True)
    for k in range(3):
        assert close_ups.sort(1.0 + 0.1 * k, (legs,)) == ((legs,), False)
    strode = box(has_legs=False)
    assert close_ups.sort(1.4, (strode,)) == ((strode,), False)
    assert not close_ups.doubtful
