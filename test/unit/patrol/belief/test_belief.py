"""The belief over pictures and scans: birth, merge, veto, motion, verdict, second looks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from belief_pictures import EAST, SOUTH, WEST, Seen, box_of, calibration, eye_at, open_view
from floors import TWO_ROOMS, drawn_floor
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.belief import Belief, PictureView
from rosbot_patrol.patrol.belief.likelihoods import Veto
from rosbot_patrol.patrol.belief.second_look import best_second_look, expected_gain
from rosbot_patrol.patrol.intruder.known_objects import KnownObject
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.records.inputs import Frame
from rosbot_patrol.patrol.records.mission import Verdict
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint


def view(pose: Pose2D, way: float = 1.0) -> Viewpoint:
    return Viewpoint(pose=pose, turn=0.5, gain=0.0, way=way)


def track(x: float, y: float, at: float = 0.1, *, has_moved: bool = True) -> LidarTrack:
    return LidarTrack(first=np.zeros((3, 2)), start=(x - 1.0, y), since=0.0, x=x, y=y, at=at, has_moved=has_moved)


def test_a_person_is_confirmed_once_by_some_pictures() -> None:
    seen = Seen()
    assert seen.see(WEST, box_of(WEST)) == []
    (found,) = seen.see(WEST, box_of(WEST), pictures=9)
    assert found.place.tolist() == pytest.approx([0.0, 0.0], abs=0.05)
    assert found.best is not None
    judgement = seen.belief.verdict(floor_seen=False)
    assert judgement.verdict is Verdict.CONFIRMED
    assert judgement.of is found
    assert "a person at about (" in judgement.why


def test_an_empty_room_is_clear_if_its_floor_was_seen() -> None:
    seen = Seen()
    seen.see(WEST, pictures=20)
    assert seen.belief.hypotheses == []
    assert seen.belief.verdict(floor_seen=True).verdict is Verdict.CLEAR
    assert seen.belief.verdict(floor_seen=False).verdict is Verdict.UNVERIFIED


def test_a_miss_lowers() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST))
    before = seen.posterior
    seen.see(WEST)
    assert seen.posterior < before


@pytest.mark.parametrize("yaw", [1.0, 3.0])
def test_out_of_view_nothing_is_missed(yaw: float) -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST))
    before = seen.posterior
    seen.see(Pose2D(-3.0, 0.0, yaw), pictures=10)
    assert seen.posterior == before


def test_behind_something_nothing_is_missed() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST))
    before = seen.posterior
    seen.see(SOUTH, pictures=10, length=1.5)
    assert seen.posterior == before


def test_one_false_box_from_each_of_two_sides_confirms_nobody() -> None:
    seen = Seen()
    for eye in (WEST, SOUTH, EAST):
        assert seen.see(eye, box_of(eye, score=0.5)) == []
        assert seen.see(eye, pictures=9) == []
    assert not seen.only.is_confirmed


def test_hypotheses_at_one_place_are_merged() -> None:
    seen = Seen()
    seen.see(WEST, replace(box_of(WEST, 0.0, 0.0), measured=None))
    assert len(seen.belief.hypotheses) == 1
    seen.belief.hypotheses.append(replace(seen.only, number=9, seen_at=-1.0, sides=[]))
    seen.see(WEST)
    assert seen.only.number == 1


def test_two_of_one_picture_are_not_merged() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST, 0.0, 0.3), box_of(WEST, 0.0, -0.3), pictures=10)
    assert len(seen.belief.hypotheses) == 2
    assert all(h.is_confirmed for h in seen.belief.hypotheses)


def test_known_objects_are_vetoed() -> None:
    seen = Seen(known=(KnownObject(x=0.0, y=0.0, name="statue"),))
    assert seen.see(WEST, box_of(WEST), pictures=20) == []
    assert seen.only.veto is Veto.KNOWN
    assert seen.belief.verdict(floor_seen=True).verdict is Verdict.CLEAR


def test_outside_is_vetoed() -> None:
    seen = Seen(floor=drawn_floor(*TWO_ROOMS))
    eye = Pose2D(2.0, 2.0, 0.0)
    assert seen.see(eye, box_of(eye, 16.0, 2.0), pictures=20) == []
    assert seen.only.veto is Veto.OUTSIDE
    inside = Seen(floor=drawn_floor(*TWO_ROOMS))
    assert len(inside.see(eye, box_of(eye, 6.0, 2.0), pictures=20)) == 1


@pytest.mark.parametrize(
    "frame",
    [
        Frame(stamp=1.0, boxes=(box_of(WEST),), eye=eye_at(WEST), is_same=True),
        Frame(stamp=1.0, boxes=(box_of(WEST),), eye=eye_at(WEST), counts=False),
        Frame(stamp=-1.0, boxes=(box_of(WEST),), eye=eye_at(WEST)),
        Frame(stamp=1.0, boxes=(replace(box_of(WEST), label="dog"),), eye=eye_at(WEST)),
        Frame(stamp=1.0, boxes=(replace(box_of(WEST), probability=0.05),), eye=eye_at(WEST)),
    ],
)
def test_pictures_that_prove_nothing(frame: Frame) -> None:
    belief = Belief()
    belief.start(0.0)
    assert belief.see(1.0, frame, open_view(WEST)) == []
    assert belief.hypotheses == []


def test_what_the_lidar_sees_move_is_open_until_the_camera_saw_it() -> None:
    seen = Seen()
    seen.belief.motion([track(0.0, 0.0), track(3.0, 3.0, has_moved=False)])
    assert seen.belief.verdict(floor_seen=True).verdict is Verdict.UNVERIFIED
    assert "the lidar saw it move" in seen.belief.verdict(floor_seen=True).why
    seen.see(WEST, pictures=8)
    seen.see(SOUTH, pictures=8)
    assert seen.belief.verdict(floor_seen=True).verdict is Verdict.CLEAR


def test_motion_makes_a_person_likelier() -> None:
    still, moving = Seen(), Seen()
    for seen in (still, moving):
        seen.see(WEST, box_of(WEST, score=0.3))
    moving.belief.motion([track(0.1, 0.0, 0.2)])
    assert moving.posterior > still.posterior


def test_a_place_that_a_walker_has_left_tells_nothing() -> None:
    walked, stood = Seen(), Seen()
    for seen in (walked, stood):
        seen.see(WEST, box_of(WEST, score=0.5))
    walked.belief.motion([track(0.1, 0.0, 0.2)])
    before = walked.posterior
    for seen in (walked, stood):
        seen.now += 20.0
        seen.see(SOUTH, pictures=30)
    assert walked.posterior == pytest.approx(before, abs=0.01)
    assert stood.posterior < 0.5 * before


@pytest.mark.parametrize(
    ("has_scan", "moves", "hypotheses"),
    [(True, False, 2), (True, True, 1), (False, False, 1)],
    ids=["the lidar sees nobody move", "the lidar saw it move", "no lidar"],
)
def test_who_the_lidar_does_not_see_move_is_not_elsewhere_later(has_scan: bool, moves: bool, hypotheses: int) -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST), pictures=5, has_scan=has_scan)
    if moves:
        seen.belief.motion([track(0.1, 0.0, seen.now + 0.05)])
    seen.now += 8.0
    seen.see(WEST, box_of(WEST, 1.0, 1.5, score=0.3), has_scan=has_scan)
    assert len(seen.belief.hypotheses) == hypotheses


def test_a_place_that_was_empty_before_somebody_came_is_no_evidence_against_them() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST, score=0.15))
    seen.see(WEST, pictures=40)
    seen.see(SOUTH, pictures=40)
    assert seen.posterior < 0.001
    seen.belief.motion([track(0.1, 0.0, seen.now)])
    assert seen.posterior > 0.1
    (found,) = seen.see(EAST, box_of(EAST), pictures=10)
    assert found.is_confirmed


def test_start_forgets() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST), pictures=10)
    seen.belief.start(100.0)
    assert seen.belief.hypotheses == []
    assert seen.see(WEST, box_of(WEST), pictures=3) == []


def test_the_number_of_hypotheses_is_bounded() -> None:
    seen = Seen()
    for k in range(100):
        seen.see(WEST, box_of(WEST, 0.1 * k, 0.9 * (k % 3 - 1), score=0.15))
    assert len(seen.belief.hypotheses) <= 60


@given(st.lists(st.tuples(st.floats(-1.0, 2.0), st.floats(-1.0, 1.0), st.floats(0.05, 1.0)), max_size=12))
def test_a_posterior_is_a_probability(boxes: list[tuple[float, float, float]]) -> None:
    seen = Seen()
    for x, y, score in boxes:
        seen.see(WEST, box_of(WEST, x, y, score=score))
    for h in seen.belief.hypotheses:
        assert 0.0 <= seen.belief.posterior(h) <= 1.0
        assert seen.belief.why(h)
        assert np.linalg.eigvalsh(h.spread)[0] > 0.0


def test_a_second_look_is_from_another_side_once_the_first_has_said_its_word() -> None:
    seen = Seen()
    for _ in range(8):
        seen.see(WEST, box_of(WEST, score=0.15))
        seen.see(WEST)
    assert seen.belief.open
    again, other = view(Pose2D(-2.8, 0.1, 0.0)), view(SOUTH)
    assert best_second_look(seen.belief, seen.only, [again, other]) is other
    assert expected_gain(seen.belief, seen.only, SOUTH) > expected_gain(seen.belief, seen.only, again.pose)


def test_a_second_look_is_nearer_by_way_or_by_sight() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST, score=0.3))
    assert best_second_look(seen.belief, seen.only, [view(SOUTH, way=9.0), view(EAST)]).pose == EAST  # type: ignore[union-attr]
    assert best_second_look(seen.belief, seen.only, []) is None
    assert best_second_look(seen.belief, seen.only, [view(Pose2D(-20.0, 0.0, 0.0))]) is None


def test_what_was_too_near_is_looked_at_from_farther_off() -> None:
    seen = Seen()
    near = Pose2D(-0.6, 0.0, 0.0)
    seen.see(near, box_of(near, tall=0.5, is_cut_above=True), pictures=5)
    assert seen.only.is_near_only
    assert expected_gain(seen.belief, seen.only, Pose2D(0.0, 1.0, -1.57)) == 0.0
    assert expected_gain(seen.belief, seen.only, SOUTH) > 0.0


def test_without_a_place_a_person_is_confirmed_by_pictures_in_a_row() -> None:
    """A robot whose camera has no pose: only for as long as pictures show it, and nothing tells a pet."""
    belief = Belief(calibration(), threshold=0.06)
    belief.start(0.0)
    box, shown = replace(box_of(WEST), measured=None), []
    for k in range(8):
        shown = belief.see(0.1 * k, Frame(boxes=(box,)), PictureView())
    assert [each.is_confirmed for each in shown] == [True]
    assert belief.why(shown[0]).startswith("a person somewhere in view with probability")


def test_without_a_place_scattered_boxes_are_nobody() -> None:
    belief = Belief(calibration(), threshold=0.06)
    belief.start(0.0)
    box = replace(box_of(WEST, score=0.3), measured=None)
    for k in range(200):
        belief.see(0.1 * k, Frame(boxes=(box,) if k % 15 == 0 else ()), PictureView())
    assert not any(each.is_confirmed for each in belief.hypotheses)


def test_things_of_other_classes_are_no_smaller_persons() -> None:
    hydrant = replace(box_of(WEST, tall=0.6), label="fire hydrant")
    flat = replace(box_of(WEST, tall=0.6, is_flat=True), label="fire hydrant")
    for box, is_confirmed in ((hydrant, True), (flat, False)):
        seen = Seen(classes=("person", "fire hydrant"))
        seen.see(WEST, box, pictures=8)
        assert seen.only.label == "fire hydrant"
        assert seen.only.is_confirmed == is_confirmed
    assert Seen().see(WEST, hydrant, pictures=8) == []


def test_a_known_object_is_named() -> None:
    seen = Seen(known=(KnownObject(x=0.0, y=0.0, name="the statue", label="person"),))
    seen.see(WEST, box_of(WEST), pictures=8)
    assert seen.belief.vetoes == {"it is the statue at (0.0, 0.0)": 8}
    assert not seen.only.is_confirmed


def test_a_pet_from_near_that_shows_no_person_from_afar_is_nobody() -> None:
    near, seen = Pose2D(-0.8, 0.0, 0.0), Seen()
    seen.see(near, box_of(near, tall=0.5, is_cut_above=True), pictures=40)
    assert 0.5 < seen.posterior < seen.belief.params.confirmed_above
    for eye in (SOUTH, EAST, WEST):
        seen.see(eye, pictures=10)
    assert seen.posterior < seen.belief.params.clear_below


def test_legs_from_one_side_confirm_nobody_and_from_two_a_person() -> None:
    """A box around one leg of a dog looks like the legs of a person."""
    seen = Seen()
    for eye, is_enough in ((Pose2D(-0.8, 0.0, 0.0), False), (Pose2D(0.0, -0.8, math.pi / 2.0), True)):
        seen.see(eye, box_of(eye, tall=0.5, is_cut_above=True, has_legs=True), pictures=40)
        assert seen.only.is_confirmed == is_enough


def test_legs_longer_than_a_dogs_confirm_a_person_from_one_side() -> None:
    """Somebody stands in the robot's way, 1.1 m off: it can look from no other side."""
    seen, eye = Seen(), Pose2D(-1.1, 0.0, 0.0)
    seen.see(eye, box_of(eye, tall=0.68, is_cut_above=True, has_legs=True), pictures=20)
    assert seen.only.is_confirmed


def test_two_boxes_around_one_person_are_one_person() -> None:
    """One measured well, one that reaches to the wall behind: another place at first, the same in the end."""
    seen = Seen()
    whole = box_of(WEST)
    bust = replace(whole, probability=0.5, ymax=whole.ymin + 60)
    behind = replace(bust, measured=replace(bust.measured, x=1.5, error=0.3))
    seen.see(WEST, whole, behind, pictures=4)
    seen.see(WEST, whole, replace(bust, measured=None), pictures=4)
    for eye in (SOUTH, EAST):
        seen.see(eye, box_of(eye), pictures=6)
    assert [h.is_confirmed for h in seen.belief.hypotheses if h.is_confirmed] == [True]
    assert not any(h.together for h in seen.belief.hypotheses)


def test_two_side_by_side_are_two() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST, y=0.6), box_of(WEST, y=-0.6), pictures=8)
    a, b = seen.belief.hypotheses
    assert (a.others, b.others) == ({b.number}, {a.number})
    assert a.is_confirmed
    assert b.is_confirmed


def test_two_legs_of_one_from_near_are_one() -> None:
    near = Pose2D(-1.0, 0.0, 0.0)
    seen = Seen()
    seen.see(near, *(box_of(near, y=y, wide=0.2, is_cut=True, is_cut_above=True) for y in (0.25, -0.25)), pictures=8)
    assert len(seen.belief.hypotheses) == 1


@pytest.mark.parametrize(("pictures", "probability"), [(1, 0.9), (8, 0.3)], ids=["one picture", "a pet's boxes"])
def test_a_box_that_shows_nobody_tells_no_two_apart(pictures: int, probability: float) -> None:
    """A box beside a person that is gone in the next picture, or as low as a pet: the person may walk there later."""
    seen = Seen()
    doubtful = replace(box_of(WEST, y=-0.6, tall=0.4), probability=probability)
    seen.see(WEST, box_of(WEST, y=0.6), doubtful, pictures=pictures)
    a, b = seen.belief.hypotheses
    assert (a.others, b.others) == (set(), set())


def test_two_that_became_one_are_still_apart_from_a_third() -> None:
    """Three in a row; the middle one is lost, and found again beside the first."""
    seen = Seen()
    seen.see(WEST, *(box_of(WEST, y=y) for y in (-1.2, 0.0, 1.2)), pictures=8)
    first, middle, last = seen.belief.hypotheses
    middle.place = first.place + 0.1
    first.together.pop(middle.number)
    middle.together.pop(first.number)
    seen.see(WEST, box_of(WEST, y=-1.2), box_of(WEST, y=1.2))
    assert [h.number for h in seen.belief.hypotheses] == [first.number, last.number]
    assert (first.others, last.others) == ({last.number}, {first.number})
