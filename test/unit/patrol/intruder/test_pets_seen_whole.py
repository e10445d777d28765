"""What moves and is shown whole without a box of a person is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.intruder.pets_seen_whole import PetsSeenWhole
from rosbot_patrol.patrol.records.inputs import Box, Eye
from rosbot_patrol.patrol.visibility.coverage import Sight

EYE = Eye(pose=Pose2D(0.0, 0.0, 0.0), width=1.0)
OPEN = Sight(x=0.0, y=0.0, first=-math.pi, step=math.tau / 360.0, lengths=np.full(360, 6.0))


def thing(x: float = 3.0, y: float = 0.0, *, moved: bool = True, at: float = 10.0) -> LidarTrack:
    return LidarTrack(first=np.zeros((3, 2)), start=(0.0, 0.0), since=0.0, x=x, y=y, at=at, has_moved=moved)


def person(left: int, right: int, label: str = "person") -> Box:
    return Box(label=label, probability=0.4, xmin=left, ymin=10, xmax=right, ymax=300)


def shown(given: LidarTrack, boxes: tuple[Box, ...] = (), sight: Sight = OPEN, pictures: int = 20) -> int:
    harmless = PetsSeenWhole()
    for _ in range(pictures):
        harmless.look(10.0, EYE, sight, boxes, [given])
    return len(harmless.sightings)


def test_a_thing_that_many_pictures_show_is_harmless_where_it_is():
    harmless, dog = PetsSeenWhole(), thing()
    for _ in range(7):
        harmless.look(10.0, EYE, OPEN, (), [dog])
    assert not harmless.sightings
    harmless.look(10.1, EYE, OPEN, (), [dog])
    assert [(s.x, s.y, s.at) for s in harmless.sightings] == [(3.0, 0.0, 10.1)]


@pytest.mark.parametrize(
    "given",
    [
        thing(x=1.2),  # too near to be whole
        thing(x=1.0, y=3.0),  # beside the picture
        thing(moved=False),  # a chair that was moved
        thing(at=9.0),  # it may be gone
    ],
)
def test_other_things_say_nothing(given: LidarTrack):
    assert shown(given) == 0


def test_what_furniture_hides_says_nothing():
    assert shown(thing(), sight=Sight(x=0.0, y=0.0, first=-math.pi, step=0.1, lengths=np.full(63, 1.5))) == 0


@pytest.mark.parametrize(
    ("box", "is_nobody"),
    [
        (person(280, 360), False),
        (person(360, 420), False),  # right beside it
        (person(500, 560), True),
        (person(280, 360, "fire hydrant"), True),
    ],
)
def test_a_box_of_a_person_speaks_against_it(box: Box, is_nobody: bool):
    assert (shown(thing(), (box,)) > 0) is is_nobody
