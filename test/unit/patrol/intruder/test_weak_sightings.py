"""Weak sights by place."""

from __future__ import annotations

import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.weak_sightings import WeakSightingParams, WeakSightings
from rosbot_patrol.patrol.records.inputs import Box, Measured

WEST, SOUTH, SOUTH_WEST = Pose2D(-3.0, 0.0, 0.0), Pose2D(0.0, -3.0, 1.57), Pose2D(-3.0, -1.0, 0.3)


def box(x: float = 0.0, y: float = 0.0, score: float = 0.6, error: float = 0.2, cut: bool = False) -> Box:
    measured = Measured(x=x, y=y, error=error, away=3.0, top=1.0, height=0.7, width=0.5, is_cut_aside=cut)
    return Box(label="person", probability=score, xmin=100, ymin=50, xmax=200, ymax=250, measured=measured)


class Seen:
    """Pictures at ten a second."""

    def __init__(self, **params: float) -> None:
        self.suspects = WeakSightings(WeakSightingParams(**params))
        self.suspects.start(100.0)
        self.now = 100.0

    def see(self, eye: Pose2D, *boxes: Box, pictures: int = 5) -> list:
        found = []
        for _ in range(pictures):
            self.now += 0.1
            found += self.suspects.add(self.now, eye, boxes)
        return found


def test_two_sides_make_a_person_once() -> None:
    seen = Seen()
    assert seen.see(WEST, box(), pictures=50) == []
    assert len(seen.suspects.doubtful()) == 1
    (person,) = seen.see(SOUTH, box(0.3, 0.1, score=0.7), pictures=20)
    assert person.probability == 0.6
    assert person.pictures == 55
    assert person.boxes[0].probability == 0.7
    assert seen.suspects.doubtful() == []


def test_pictures_from_about_one_place_are_one_side() -> None:
    seen = Seen()
    assert seen.see(WEST, box(), pictures=50) == []
    assert seen.see(SOUTH_WEST, box(), pictures=50) == []
    assert len(seen.suspects.all[0].sides) == 1


@pytest.mark.parametrize("other", [box(1.0, 0.0), box(score=0.4), box(error=0.9)])
def test_another_place_a_weaker_sight_and_a_place_not_known_are_no_second_side(other: Box) -> None:
    seen = Seen()
    seen.see(WEST, box())
    assert seen.see(SOUTH, other, pictures=50) == []


def test_what_the_edge_of_the_picture_cuts_from_one_side_is_doubtful_until_it_is_sure_or_whole() -> None:
    seen = Seen()
    assert seen.see(WEST, box()) == []
    assert seen.see(SOUTH, box(score=0.7, cut=True), pictures=50) == []
    assert [(s.is_confirmed, s.is_grave) for s in seen.suspects.doubtful()] == [(False, True)]
    assert len(seen.see(SOUTH, box(score=0.7), pictures=1)) == 1
    sure = Seen()
    sure.see(WEST, box())
    assert len(sure.see(SOUTH, box(score=0.85, cut=True))) == 1


def test_two_pictures_are_a_doubt_and_few_are_no_side() -> None:
    seen = Seen()
    seen.see(WEST, box(), pictures=1)
    assert seen.suspects.doubtful() == []
    seen.see(WEST, box(score=0.4), pictures=3)
    assert len(seen.suspects.doubtful()) == 1
    assert seen.see(SOUTH, box(), pictures=9) == []


@pytest.mark.parametrize(
    ("score", "pictures", "is_grave"),
    [(0.5, 4, False), (0.5, 5, True), (0.4, 19, False), (0.4, 20, True), (0.39, 90, False)],
)
def test_what_looks_a_little_like_a_person_for_long_is_grave(score: float, pictures: int, is_grave: bool) -> None:
    seen = Seen()
    seen.see(WEST, box(score=score), pictures=pictures)
    assert [suspect.is_grave for suspect in seen.suspects.doubtful()] == [is_grave]


def test_the_same_picture_again_and_one_of_before_do_not_count() -> None:
    seen = Seen()
    for _ in range(20):
        seen.suspects.add(100.1, WEST, (box(),))
        seen.suspects.add(99.0, WEST, (box(),))
    assert seen.suspects.all[0].pictures == 1


def test_one_who_was_confirmed_is_not_again() -> None:
    seen = Seen()
    seen.see(WEST, box(), box(3.0, 0.0))
    seen.suspects.note_confirmed(box(0.2, 0.0).measured)
    (left,) = seen.suspects.doubtful()
    assert left.x == pytest.approx(3.0)
    (person,) = seen.see(SOUTH, box(), box(3.0, 0.0), pictures=30)
    assert person.measured.x == 3.0
    seen.suspects.note_confirmed(None)
    assert seen.suspects.doubtful() == []


def test_the_place_is_by_how_well_it_is_known() -> None:
    seen = Seen()
    seen.see(WEST, box(0.0, 0.0, error=0.1), box(5.0, 0.0), pictures=10)
    seen.see(SOUTH, box(0.5, 0.0, error=0.5), pictures=10)
    assert seen.suspects.all[0].x < 0.05
