"""Legs that go straight up, by depth, as a low camera sees them from near."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rosbot_patrol.patrol.intruder.legs import go_straight_up
from rosbot_patrol.patrol.intruder.measure import Depth, Lens, View, measure
from rosbot_patrol.patrol.records.inputs import Box, Measured

EYE, AWAY, WALL, STEP = 0.22, 0.6, 3.0, 0.01
HEIGHTS = np.linspace(0.48, 0.02, 48)


def seen(widths: dict[float, float], *, apart: float = 0.0) -> NDArray[np.float64]:
    """What is as wide as told from a height on, in one column or in two that stand apart [m]."""
    x = (np.arange(48) - 23.5) * STEP
    rows = []
    for height in HEIGHTS:
        width = next(w for least, w in sorted(widths.items(), reverse=True) if height >= least)
        half = width / 2.0 if not apart else width / 4.0
        is_thing = np.min([np.abs(x - side * apart / 2.0) for side in (-1, 1)], axis=0) < half
        rows.append(np.where(is_thing, AWAY, WALL))
    return np.array(rows)


@pytest.mark.parametrize(
    ("metres", "expected"),
    [
        (seen({0.0: 0.18}), True),  # from the side
        (seen({0.0: 0.24}, apart=0.2), True),
        (seen({0.0: 0.16, 0.3: 0.2}, apart=0.2), True),
        (seen({0.0: 0.09, 0.15: 0.2, 0.38: 0.1}), False),  # a dog from ahead
        (seen({0.0: 0.12, 0.25: 0.45}, apart=0.3), False),  # and from the side
        (seen({0.0: 0.2, 0.36: 0.0}), False),  # it ends
        (seen({0.0: 0.08}, apart=0.3), False),  # of a chair
        (seen({0.0: 0.44}), False),  # a box
        (np.full((48, 48), math.nan), False),
    ],
)
def test_what_goes_straight_up_has_legs(metres: NDArray[np.float64], expected: bool) -> None:
    assert go_straight_up(metres, AWAY, HEIGHTS, EYE, STEP) is expected


def test_a_picture_that_ends_below_the_knees_tells_nothing() -> None:
    assert go_straight_up(seen({0.0: 0.18}), AWAY, HEIGHTS - 0.15, EYE, STEP) is None


def test_a_box_that_begins_at_the_knees_tells_nothing() -> None:
    assert go_straight_up(seen({0.0: 0.18})[:12], AWAY, HEIGHTS[:12], EYE, STEP) is None


LENS = Lens(fx=554.38, fy=554.38, cx=320.0, cy=240.0, width=640, height=480)
LEGS = np.array([[0.6, -0.08], [0.6, -0.06], [0.6, 0.06], [0.6, 0.08]])


def stands(unmapped: NDArray[np.float64] | None) -> Measured:
    pose = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, EYE], [0.0, 0.0, 0.0, 1.0]])
    metres = np.full((480, 640), WALL, np.float32)
    metres[:, 190:300] = metres[:, 340:450] = AWAY
    box = Box(label="person", probability=0.9, xmin=185, ymin=0, xmax=455, ymax=440)
    measured = measure(box, View(LENS, pose), Depth(metres, LENS), unmapped).measured
    assert measured is not None
    return measured


def test_legs_count_where_the_lidar_meets_what_the_map_does_not_show() -> None:
    assert stands(LEGS).has_legs is True
    assert stands(LEGS).top < 0.6


@pytest.mark.parametrize("unmapped", [None, np.empty((0, 2)), LEGS + np.array([2.0, 0.0])])
def test_legs_of_a_table_that_the_map_shows_are_nobodys(unmapped: NDArray[np.float64] | None) -> None:
    assert stands(unmapped).has_legs is None
