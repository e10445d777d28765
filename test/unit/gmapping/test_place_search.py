"""A scan that is placed on a map without a good guess."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D, invert, transform_points
from rosbot_patrol.gmapping.loops.place_search import WallField
from rosbot_patrol.gmapping.loops.search_kernels import fill_pyramid, find_best

ROOM = np.zeros((120, 150), dtype=bool)
ROOM[20, 20:130] = ROOM[100, 20:90] = ROOM[20:101, 20] = ROOM[60, 90:130] = True
POINTS = np.argwhere(ROOM)[::3, ::-1] + 0.5


@pytest.mark.parametrize("seed", range(5))
def test_the_best_of_all_shifts_and_turns_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    levels = np.zeros((4, 40, 50), dtype=np.uint8)
    levels[0] = rng.integers(0, 255, (40, 50)) * (rng.random((40, 50)) < 0.2)
    fill_pyramid(levels)
    turned = rng.integers(8, 32, (6, 30, 2)).astype(np.int32)
    best = np.zeros(4, dtype=np.int64)
    find_best(levels, turned, 7, 0, best)

    def total(a: int, dx: int, dy: int) -> int:
        return int(levels[0][turned[a, :, 1] + dy, turned[a, :, 0] + dx].sum())

    shifts = range(-7, 8)
    most = max(total(a, dx, dy) for a in range(6) for dx in shifts for dy in shifts)
    assert best[3] == most == total(*best[:3])
    find_best(levels, turned, 7, most, best)
    assert best[0] == -1


@pytest.mark.parametrize("off", [Pose2D(9.0, -8.0, 0.4), Pose2D(-3.0, 10.0, -0.45), Pose2D()])
def test_a_place_is_found_within_the_reach(off: Pose2D) -> None:
    true = Pose2D(70.0, 55.0, 0.7)
    seen = transform_points(invert(true), POINTS)
    guess = Pose2D(*(np.array(true) + off))
    found = WallField(ROOM, np.zeros(2), 10).find(seen, guess, 0.5)
    assert found is not None
    assert math.hypot(found[0] - true.x, found[1] - true.y) < 2.0
    assert abs(found[2] - true.yaw) < 0.03


def test_points_that_fit_nowhere_have_no_place() -> None:
    field = WallField(ROOM, np.zeros(2), 10)
    assert field.find(np.random.default_rng(1).uniform(-30.0, 30.0, (200, 2)), Pose2D(70.0, 60.0, 0.0), 0.5) is None
    assert field.find(np.empty((0, 2)), Pose2D(70.0, 60.0, 0.0), 0.5) is None
