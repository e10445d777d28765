from __future__ import annotations

import pytest
from floors import TWO_ROOMS, drawn_floor

from rosbot_patrol.patrol.intruder.exclusions import Exclusions, KnownObject
from rosbot_patrol.patrol.records.inputs import Box, Measured

FLOOR = drawn_floor(*TWO_ROOMS)


def box(*, label: str = "person", ymin: int = 60, ymax: int = 400, measured: bool = True, **fields) -> Box:
    defaults = {
        "x": 2.0, "y": 2.0, "error": 0.1, "away": 2.0, "top": 1.7, "height": 1.6, "width": 0.5, "is_flat": False,
    }  # fmt: skip
    m = Measured(**{**defaults, **fields}) if measured else None
    return Box(label=label, probability=0.9, xmin=100, ymin=ymin, xmax=200, ymax=ymax, measured=m)


def test_one_who_stands_in_the_room_is_not_refused() -> None:
    assert Exclusions(floor=FLOOR).refusal(box()) == ""


def test_what_was_not_measured_is_not_refused() -> None:
    assert Exclusions(floor=FLOOR).refusal(box(measured=False)) == ""


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"top": 0.55, "height": 0.5, "width": 0.7}, "as low as a pet"),
        ({"top": 0.55, "height": 0.5, "width": 0.7, "source": "floor", "error": 0.25}, "as low as a pet"),
        ({"top": 2.8, "height": 2.7}, "too large"),
        ({"width": 2.9}, "too large"),
        ({"top": 1.2, "height": 0.2}, "too small"),
        ({"is_flat": True}, "flat"),
        ({"x": 40.0}, "outside"),
        ({"x": 2.0, "y": -1.5}, "outside"),
    ],
)
def test_what_cannot_be_an_intruder_is_refused(fields: dict[str, float], why: str) -> None:
    assert why in Exclusions(floor=FLOOR).refusal(box(**fields))


@pytest.mark.parametrize(
    "fields",
    [
        {"top": 0.95, "height": 0.9},  # crouching
        {"top": 0.5, "height": 0.45, "width": 1.6},  # lying
        {"top": 1.2, "height": 0.5},  # behind a sofa
        {"top": 0.8, "height": 0.6, "is_cut": True, "ymin": 0},  # near: the picture ends above the belt
        {"top": 0.6, "height": 0.5, "is_cut_aside": True},  # a knee at the side of the picture
        {"top": 0.75, "height": 0.7, "is_cut": True, "ymin": 14},  # likewise, in a box that begins a little too low
        {"x": 2.0, "y": 0.2},  # in the bed along the wall, whose inside the map does not know
        {"source": "floor", "top": 0.5, "error": 1.5},  # too unsure to say
        {"is_flat": None},
    ],
)
def test_who_may_be_one_is_not_refused(fields: dict[str, float]) -> None:
    assert Exclusions(floor=FLOOR).refusal(box(**fields)) == ""


def test_the_size_of_other_classes_is_not_a_persons() -> None:
    assert Exclusions().refusal(box(label="fire hydrant", top=0.6, height=0.6)) == ""
    assert Exclusions().refusal(box(label="fire hydrant", top=0.6, height=0.6, is_flat=True)) != ""


def test_a_thing_has_to_be_whole_in_the_picture_from_left_to_right() -> None:
    refusal = Exclusions().refusal(box(label="fire hydrant", top=0.6, height=0.6, is_cut_aside=True))
    assert refusal == "only a part of it is in the picture"
    assert Exclusions().refusal(box(label="fire hydrant", top=0.6, height=0.6, is_cut=True)) == ""


def test_a_known_object_is_refused_where_it_stands_only() -> None:
    exclusions = Exclusions(known=(KnownObject(x=2.0, y=2.0, radius=0.4, name="the statue", label="person"),))
    assert exclusions.refusal(box()) == "it is the statue at (2.0, 2.0)"
    assert exclusions.refusal(box(x=3.0)) == ""
    assert exclusions.refusal(box(label="fire hydrant")) == ""


def test_without_a_map_nobody_is_outside() -> None:
    assert Exclusions().refusal(box(x=40.0)) == ""
