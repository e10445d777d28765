"""The urn, the sides and the posterior, by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from belief_pictures import EAST, SOUTH, WEST, calibration
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.calibration import EDGES, Condition, outcome
from rosbot_patrol.patrol.belief.hypothesis import Hypothesis, Side, entropy, posterior, urn
from rosbot_patrol.patrol.belief.likelihoods import Evidence, Likelihoods, Veto
from rosbot_patrol.patrol.belief.params import BeliefParams

PARAMS = BeliefParams()
NETWORK = calibration()
JUDGE = Likelihoods(NETWORK, PARAMS, 0.05)
PERSON, NOBODY = JUDGE.chances(Condition(0.3))


def said(score: float, **given: object) -> Evidence:
    return replace(Evidence(outcome(score), PERSON, NOBODY), **given)  # type: ignore[arg-type]


def side_of(*scores: float) -> Side:
    side = Side(WEST)
    for score in scores:
        side.add(said(score), NETWORK)
    return side


def whole(*sides: Side) -> Hypothesis:
    return Hypothesis(1, np.zeros(2), np.eye(2) * 0.04, 0.0, sides=list(sides))


FOOLED = NETWORK.fooled


def test_posterior_by_hand() -> None:
    pet = 0.004 * (FOOLED * math.exp(2.0 + 5.0 - 3.0) + (1.0 - FOOLED) * math.exp(2.0 - 3.0))
    picture = 0.002 * math.exp(2.0 + 5.0 - 1.0)
    odds = 0.01 * math.exp(2.0 + 5.0) / (pet + picture + 0.984)
    assert posterior(2.0, np.array([5.0]), np.array([3.0, 1.0]), PARAMS, FOOLED) == pytest.approx(odds / (1.0 + odds))
    assert posterior(0.0, np.array([0.0]), np.zeros(2), PARAMS, FOOLED) == pytest.approx(PARAMS.prior)
    for all_, told in ((1e6, 1.0), (-1e6, 0.0)):
        assert posterior(all_, np.array([all_]), np.full(2, all_), PARAMS, FOOLED) == pytest.approx(told)
    assert posterior(0.0, np.array([1e6]), np.full(2, math.inf), PARAMS, FOOLED) == pytest.approx(1.0)


def test_without_a_size_a_look_alike_is_as_good_an_explanation() -> None:
    assert posterior(50.0, np.array([0.0]), np.zeros(2), PARAMS, FOOLED) == pytest.approx(0.01 / 0.016)
    as_whole = posterior(0.0, np.array([50.0]), np.zeros(2), PARAMS, FOOLED)
    assert as_whole == pytest.approx(0.01 / (0.012 + 0.004 * FOOLED))


@pytest.mark.parametrize("size", [0.0, -1.0, -5.0])
def test_a_network_that_pets_rarely_fool_needs_less_of_a_size(size: float) -> None:
    """Somebody who crouches is as low as a large dog; against a picture it takes depth as before."""
    rarely, often = (posterior(0.0, np.array([20.0]), np.array([size, 5.0]), PARAMS, fooled) for fooled in (0.05, 0.5))
    assert rarely > often
    assert (rarely > 0.95) == (size == 0.0)
    flat = [posterior(0.0, np.array([20.0]), np.array([3.0, -4.0]), PARAMS, fooled) for fooled in (0.05, 0.5)]
    assert max(flat) < 0.1


def test_a_pet_that_fools_the_network_from_one_side_does_not_from_two_more() -> None:
    """Of 16 sides from which recorded pets fooled a network, none had another side with it."""
    low = np.array([-0.5, 5.0])
    one, three = (posterior(0.0, np.full(sides, 6.0), low, PARAMS, 0.15) for sides in (1, 3))
    assert one < 0.9
    assert three > 0.99


def test_legs_that_the_network_does_not_find_are_missed_from_all_sides_together() -> None:
    sides = [Side(WEST, near_sum=8.0), Side(SOUTH, near_sum=-3.0), Side(EAST, near_sum=-3.0)]
    seen = Hypothesis(1, np.zeros(2), np.eye(2), 0.0, sides=sides, moved=1.0)
    assert seen.near == pytest.approx(9.0 + math.log(0.03))


def test_a_pet_that_looked_alike_from_near_and_whole_does_not_is_no_person() -> None:
    assert posterior(20.0, np.array([-10.0]), np.zeros(2), PARAMS, FOOLED) < 1e-3


def test_urn_by_hand() -> None:
    chances = np.array([0.5, 0.5, 0.0])
    assert urn(np.zeros(3), 1, chances, 0.5) == pytest.approx(0.5)
    assert urn(np.array([0.0, 3.0, 0.0]), 1, chances, 0.5) == pytest.approx((3 + 0.5) / 4)  # s = 1
    assert urn(np.array([0.0, 3.0, 0.0]), 0, chances, 0.5) == pytest.approx(0.5 / 4)


def test_independent_pictures_add_up() -> None:
    free = calibration(rho_person=1e-6, rho_nobody=1e-6)
    side = Side(WEST)
    for _ in range(3):
        side.add(said(0.9), free)
    k = outcome(0.9)
    assert side.score == pytest.approx(3.0 * math.log(PERSON[k] / NOBODY[k]), rel=1e-3)


def test_first_picture_by_hand() -> None:
    k = outcome(0.9)
    assert side_of(0.9).score == pytest.approx(math.log(PERSON[k] / NOBODY[k]))
    assert side_of(0.0).score == pytest.approx(math.log(PERSON[0] / NOBODY[0]))


def test_ten_pictures_of_one_side_count_far_less_than_two_sides() -> None:
    ten, five, one = (side_of(*[0.9] * n).score for n in (10, 5, 1))
    assert one < five < ten < 10.0 * one / 4.0
    assert ten < 0.75 * (five + five)  # as many pictures, half of them from another side


def test_misses_of_one_side_agree() -> None:
    ten, one = side_of(*[0.0] * 10).score, side_of(0.0).score
    assert ten < one < 0.0
    assert ten > 2.0 * one


def test_one_side_alone_never_says_that_surely_nobody_is_there() -> None:
    """A network may find nobody in a rare pose, or behind a plant, in a hundred pictures alike."""
    hundred = side_of(*[0.0] * 100)
    assert hundred.score == pytest.approx(math.log(0.03))
    assert whole(hundred).posterior(PARAMS, FOOLED) < 0.001
    assert whole(hundred, hundred).wholes == pytest.approx([math.log(0.03)] * 2)


def test_a_person_who_is_missed_often_and_seen_now_and_then_is_still_likelier_than_nobody() -> None:
    assert side_of(*[0.0] * 10, 0.7, 0.7).score > 0.0


@given(st.lists(st.sampled_from([0.0, 0.07, 0.3, 0.7, 0.9, 0.99]), max_size=12), st.randoms())
def test_the_order_within_a_side_does_not_matter(scores: list[float], random: object) -> None:
    mixed = list(scores)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    assert side_of(*mixed).score == pytest.approx(side_of(*scores).score, abs=1e-9)


@given(st.lists(st.sampled_from([0.0, 0.3, 0.9]), max_size=8), st.floats(0.05, 1.0), st.floats(0.05, 1.0))
def test_the_first_score_never_lowers_the_evidence(before: list[float], a: float, b: float) -> None:
    low, high = sorted((a, b))
    fresh = Side(WEST)
    assert fresh.told(said(high), NETWORK) >= fresh.told(said(low), NETWORK) - 1e-9
    known = side_of(*before)
    assert known.told(said(0.9), NETWORK) >= known.told(said(0.0), NETWORK)


@given(st.floats(0.0, 1.0))
def test_a_place_that_was_hardly_in_view_says_little(weight: float) -> None:
    part, full = Side(WEST), Side(WEST)
    part.add(said(0.0, weight=weight), NETWORK)
    full.add(said(0.0), NETWORK)
    assert full.score - 1e-9 <= part.score <= 1e-9


def test_sides_are_told_apart_by_bearing_and_distance() -> None:
    h = whole()
    first = h.side(WEST, PARAMS)
    assert h.side(Pose2D(-2.9, 0.3, 0.0), PARAMS) is first
    assert h.side(SOUTH, PARAMS) is not first
    assert h.side(Pose2D(-1.5, 0.0, 0.0), PARAMS) is not first  # half as far
    assert len(h.sides) == 3


def test_a_better_place_joins_two_views_of_one_side() -> None:
    h = whole()
    first = h.side(WEST, PARAMS)
    h.place = np.array([8.0, 0.0])
    assert h.side(WEST, PARAMS) is first


def test_false_boxes_of_one_side_are_expected_from_the_next() -> None:
    h = whole()
    for _ in range(10):
        h.take(WEST, said(0.9), NETWORK, PARAMS)
    for _ in range(10):
        h.take(SOUTH, said(0.9), NETWORK, PARAMS)
    west, south = h.sides
    assert 0.0 < south.score < west.score


def test_sizes_of_one_side_agree() -> None:
    side = Side(WEST)
    for _ in range(10):
        side.add(said(0.9, size=np.array([2.0, 1.0])), NETWORK)
    assert side.size(PARAMS) == pytest.approx(np.array([20.0, 10.0]) / (1.0 + 9.0 * PARAMS.size_rho))


def test_a_veto_needs_most_boxes() -> None:
    h = whole()
    h.possible = 3
    h.against.update([Veto.FLAT, Veto.FLAT])
    assert h.veto is None
    h.against.update([Veto.FLAT, Veto.FLAT])
    assert h.veto is Veto.FLAT
    h.place_veto = Veto.KNOWN
    assert h.veto is Veto.KNOWN


def test_why_is_one_sentence() -> None:
    h = whole(side_of(0.9, 0.9, 0.0))
    h.boxes = h.possible = 2
    assert h.why(PARAMS, FOOLED).startswith("a person at about (0.0, 0.0) with probability ")
    assert "2 boxes and 1 pictures without one from 3.0 m" in h.why(PARAMS, FOOLED)
    h.place_veto = Veto.OUTSIDE
    assert h.why(PARAMS, FOOLED) == f"what was seen at about (0.0, 0.0) is no intruder: {Veto.OUTSIDE.value}"


def test_the_place_of_a_walker_follows() -> None:
    h = whole()
    h.move(np.array([3.0, 0.0]), np.eye(2) * 0.04, 5.0, PARAMS)
    assert h.place[0] > 2.9
    assert h.error < 0.25


def test_absorbing_counts_a_side_once() -> None:
    a, b = whole(side_of(0.9)), whole(side_of(0.9, 0.9))
    a.absorb(b, PARAMS)
    assert len(a.sides) == 1
    assert a.wholes.sum() == pytest.approx(side_of(0.9, 0.9).score)
    other = whole(Side(EAST, whole_sum=2.0))
    a.absorb(other, PARAMS)
    assert a.wholes.sum() == pytest.approx(side_of(0.9, 0.9).score + 2.0)


def test_entropy() -> None:
    assert entropy(0.0) == entropy(1.0) == 0.0
    assert entropy(0.5) == pytest.approx(math.log(2.0))
    assert len(PERSON) == len(EDGES)
