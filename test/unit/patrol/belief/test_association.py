"""Which box belongs to which hypothesis."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from belief_pictures import COLUMNS, EAST, SOUTH, WEST, Seen, box_of, eye_at, open_view
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.association import assign, distinct, locate
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis
from rosbot_patrol.patrol.belief.params import BeliefParams

PARAMS = BeliefParams()


def somebody(x: float, y: float, *, at: float = 0.0, number: int = 1) -> Hypothesis:
    return Hypothesis(number, np.array([x, y]), np.eye(2) * 0.02, at)


def test_each_box_takes_the_nearest() -> None:
    left, right = somebody(0.0, 0.8), somebody(0.0, -0.8, number=2)
    located = [locate(box_of(WEST, 0.0, y), eye_at(WEST)) for y in (-0.7, 0.7)]
    assert assign([left, right], located, 0.1, PARAMS) == [right, left]


def test_a_hypothesis_takes_one_box() -> None:
    one = somebody(0.0, 0.0)
    located = [locate(box_of(WEST, 0.0, y), eye_at(WEST)) for y in (0.05, 0.2)]
    assert assign([one], located, 0.1, PARAMS) == [one, None]


def test_the_gate_grows_with_time() -> None:
    located = [locate(box_of(WEST, 2.0, 0.0), eye_at(WEST))]
    one = somebody(0.0, 0.0)
    assert assign([one], located, 0.1, PARAMS) == [None]
    assert assign([one], located, 3.0, PARAMS) == [one]


def test_who_was_out_of_view_for_long_does_not_take_the_boxes_of_somebody_else() -> None:
    unseen, present = somebody(0.0, 1.2), somebody(0.0, 0.0, at=19.9, number=2)
    located = [locate(box_of(WEST, 0.0, 0.2), eye_at(WEST))]
    assert assign([unseen, present], located, 20.0, PARAMS) == [present]
    both = [*located, locate(box_of(WEST, 0.0, 1.1), eye_at(WEST))]
    assert assign([unseen, present], both, 20.0, PARAMS) == [present, unseen]


def test_nobody_walks_farther_than_the_bound() -> None:
    located = [locate(box_of(WEST, 6.0, 0.0), eye_at(WEST))]
    assert assign([somebody(0.0, 0.0)], located, 1e6, PARAMS) == [None]


def test_two_persons_who_cross_stay_two() -> None:
    seen = Seen()
    for k in range(41):
        y = -1.0 + 0.05 * k
        seen.see(WEST, box_of(WEST, 0.0, y), box_of(WEST, 1.2, -y))
    first, second = seen.belief.hypotheses
    assert (round(first.place[0], 1), round(second.place[0], 1)) == (0.0, 1.2)
    assert first.place[1] == pytest.approx(1.0, abs=0.2)
    assert second.place[1] == pytest.approx(-1.0, abs=0.2)


def test_a_bearing_alone_is_a_long_thin_spread_before_the_wall() -> None:
    box = replace(box_of(WEST, 4.0, 0.0), measured=None)
    found = locate(box, eye_at(WEST), open_view(WEST, length=3.0).sight)
    assert found.place.tolist() == pytest.approx([0.2, 0.0], abs=0.1)  # the wall is at x = 0
    across, along = np.sqrt(np.linalg.eigvalsh(found.spread))
    assert along > 5.0 * across


def test_two_bearings_make_a_place() -> None:
    seen = Seen()
    seen.see(WEST, replace(box_of(WEST, 0.0, 0.0), measured=None))
    seen.see(SOUTH, replace(box_of(SOUTH, 0.0, 0.0), measured=None))
    assert seen.only.place.tolist() == pytest.approx([0.0, 0.0], abs=0.4)
    assert seen.only.error < 0.4


def test_a_bearing_belongs_to_what_stands_there() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST, 0.5, 0.3))
    seen.see(WEST, replace(box_of(WEST, 0.5, 0.3), measured=None))
    assert seen.only.place.tolist() == pytest.approx([0.5, 0.3], abs=0.1)


def test_something_too_far_to_be_measured_has_about_a_place() -> None:
    box = replace(box_of(WEST, 4.0, 0.0), measured=None, doubt=(5.0, 0.0))
    assert locate(box, eye_at(WEST)).place.tolist() == [5.0, 0.0]


def test_two_boxes_around_one_body_are_one() -> None:
    whole, chest = box_of(EAST, score=0.9), box_of(EAST, score=0.5, tall=0.8)
    located = [locate(box, eye_at(EAST)) for box in (chest, whole)]
    assert [each.box for each in distinct(located, PARAMS)] == [whole]


def test_two_persons_beside_each_other_are_two() -> None:
    located = [locate(box_of(WEST, 0.0, y), eye_at(WEST)) for y in (-0.3, 0.3)]
    assert len(distinct(located, PARAMS)) == 2


@given(st.floats(-2.0, 3.0), st.floats(-1.0, 1.0), st.floats(0.0, 20.0))
def test_the_spread_never_shrinks_with_time(x: float, y: float, later: float) -> None:
    one = somebody(x, y)
    assert np.linalg.eigvalsh(one.spread_at(later, PARAMS) - one.spread)[0] >= -1e-12


@given(st.floats(0.5, 8.0), st.floats(-0.4, 0.4))
def test_a_box_without_a_place_keeps_its_bearing(away: float, aside: float) -> None:
    eye = Pose2D(1.0, 2.0, 0.7)
    x, y = eye.x + away * math.cos(eye.yaw + aside), eye.y + away * math.sin(eye.yaw + aside)
    box = replace(box_of(eye, x, y), measured=None)
    place = locate(box, eye_at(eye)).place
    middle = eye.yaw + eye_at(eye).bearing((box.xmin + box.xmax) / 2.0)
    assert math.atan2(place[1] - eye.y, place[0] - eye.x) == pytest.approx(middle, abs=1e-6)
    assert box.xmax <= COLUMNS
