"""What a box, and the lack of one, says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from belief_pictures import WEST, box_of, calibration, eye_at
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, Condition
from rosbot_patrol.patrol.belief.likelihoods import Likelihoods, Veto, possibility
from rosbot_patrol.patrol.belief.params import BeliefParams

PARAMS = BeliefParams()
EYE = eye_at(WEST)


def judge(threshold: float = 0.1) -> Likelihoods:
    return Likelihoods(calibration(), PARAMS, threshold)


def ratio(score: float) -> float:
    found = judge().box(box_of(WEST, score=score), EYE)
    return math.log(found.person[found.outcome] / found.nobody[found.outcome])


@given(st.floats(0.1, 1.0), st.floats(0.1, 1.0))
def test_a_surer_box_never_says_less(a: float, b: float) -> None:
    low, high = sorted((a, b))
    assert ratio(high) >= ratio(low) - 1e-9


def test_no_single_picture_says_more_than_the_bound() -> None:
    bold = replace(calibration(), nobody=np.where(calibration().nobody > 0.5, calibration().nobody, 1e-9))
    person, nobody = Likelihoods(bold, PARAMS, 0.05).chances(Condition(0.3))
    assert np.log(person / nobody).max() == pytest.approx(PARAMS.picture_most)


def test_a_miss_speaks_against_a_person() -> None:
    found = judge().miss(Condition(0.3), 1.0)
    assert found.outcome == 0
    assert found.person[0] < found.nobody[0]


def test_boxes_below_the_threshold_count_as_none() -> None:
    low, high = (judge(threshold).chances(Condition(0.3))[0] for threshold in (0.05, 0.4))
    assert high[0] == pytest.approx(low[0] + low[1:4].sum())
    assert high[1:4].tolist() == pytest.approx([0.0] * 3, abs=1e-2)


@pytest.mark.parametrize(
    ("tall", "wide", "veto"),
    [(0.5, 0.6, Veto.PET), (1.7, 0.5, None), (2.9, 0.7, Veto.LARGE), (0.4, 1.7, None), (1.0, 3.0, Veto.LARGE)],
)
def test_size(tall: float, wide: float, veto: Veto | None) -> None:
    found = possibility(box_of(WEST, tall=tall, wide=wide), PARAMS)
    assert found is not None
    assert found[1] is veto
    assert (found[0] > 0.5) == (veto is None)


def test_small_part_of_something() -> None:
    assert possibility(box_of(WEST, tall=1.5, height=0.05), PARAMS) == (pytest.approx(0.02, abs=0.1), Veto.SMALL)


@given(st.floats(0.1, 1.6), st.floats(0.1, 1.6))
def test_taller_is_likelier(a: float, b: float) -> None:
    low, high = (possibility(box_of(WEST, tall=t, height=1.0), PARAMS) for t in sorted((a, b)))
    assert low is not None
    assert high is not None
    assert low[0] <= high[0] + 1e-9


def test_flat_things_are_pictures() -> None:
    found = possibility(box_of(WEST, is_flat=True), PARAMS)
    assert found == (0.02, Veto.FLAT)


def test_what_was_not_measured_says_nothing_by_its_size() -> None:
    box = replace(box_of(WEST), measured=None)
    assert possibility(box, PARAMS) is None
    assert judge().box(box, EYE).size is None
    far = box_of(WEST, source="floor", error=0.8)
    assert possibility(far, PARAMS) is None


def test_what_goes_on_above_the_picture_and_is_low_is_too_near() -> None:
    near = judge().box(box_of(WEST, tall=0.6, is_cut_above=True), EYE)
    assert near.is_near
    assert near.size is None
    assert not judge().box(box_of(WEST, tall=1.2, is_cut_above=True), EYE).is_near


def test_the_cautious_network_does_not_speak_boldly() -> None:
    person, nobody = Likelihoods(CAUTIOUS, PARAMS, 0.05).chances(Condition(0.3))
    assert np.log(person / nobody)[1:].max() <= PARAMS.picture_most + 1e-9
    assert (np.diff(np.log(person / nobody)[1:]) >= 0.0).all()


@pytest.mark.parametrize("cut", ["is_cut_aside", "is_cut_above"])
def test_a_part_that_is_as_tall_as_a_pet_may_be_says_little(cut: str) -> None:
    """The tail of a dog at the image border, measured as far off as the wall behind it, is a metre tall."""
    low, tall = (judge().box(box_of(WEST, tall=tall, **{cut: True}), EYE).size for tall in (1.0, 1.5))
    assert low is not None
    assert tall is not None
    assert 0.0 < low[0] < 1.5
    assert tall[0] > 3.0


def test_a_size_says_little_where_it_may_be_that_of_a_picture() -> None:
    """A poster across the hall has a person's size, and is too far off for the depth camera to tell that it is flat."""
    across = Pose2D(-5.5, 0.0, 0.0)
    poster, body = (judge().box(box_of(across, tall=1.7, is_flat=flat), EYE).size for flat in (None, False))
    by_lidar = judge().box(box_of(across, tall=1.7, is_flat=None, source="lidar"), EYE).size
    dark_clothes = judge().box(box_of(WEST, tall=1.7, is_flat=None), EYE).size
    assert poster is not None
    assert 0.0 < poster[1] < 1.0
    assert poster[0] > 3.0  # a pet is not that tall
    assert by_lidar == pytest.approx(body)
    assert dark_clothes is not None
    assert (dark_clothes > 3.0).all()
    assert body is not None
    assert (body > 3.0).all()


def test_what_is_flat_is_no_person_and_what_is_low_may_be_a_pet() -> None:
    flat = judge().box(box_of(WEST, tall=1.7, is_flat=True), EYE).size
    low = judge().box(box_of(WEST, tall=0.5), EYE).size
    assert flat == pytest.approx([0.0, math.log(0.02 / 0.98)])
    assert low is not None
    assert low[0] < -3.0
    assert low[1] > 2.0


def test_legs_are_a_part_that_has_a_size() -> None:
    legs = judge().box(box_of(WEST, tall=0.6, is_cut_above=True, has_legs=True), EYE)
    assert legs.is_near
    assert legs.size is not None
