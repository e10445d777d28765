"""The search block by block against the whole field, and what straightens a way."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL
from rosbot_patrol.planning.global_planners import potential_kernels, search, straighten_kernels
from rosbot_patrol.planning.global_planners.navfn import crossing_costs

PRICES = crossing_costs(allow_unknown=True)


def bumps(rng, size):
    """Smooth costs of every height."""
    coarse = rng.random((size // 12 + 2, size // 12 + 2))
    at = np.arange(size) / 12.0
    i, f = at.astype(int), (at % 1.0)[:, None]
    rows = coarse[i] * (1 - f) + coarse[i + 1] * f
    full = rows[:, i] * (1 - f.T) + rows[:, i + 1] * f.T
    return np.ascontiguousarray(full / full.max() * 252).astype(np.uint8, order="C")


def walls(rng, size):
    cells = np.zeros((size, size), np.uint8)
    for _ in range(30):
        x, y, length = (*rng.integers(0, size, 2), rng.integers(20, size // 2))
        if rng.random() < 0.5:
            cells[y, x : x + length] = LETHAL
        else:
            cells[y : y + length, x] = LETHAL
    return cells


def rooms_of_thin_walls(rng, size):
    """Walls of one cell with gaps of a few: many blocks are open that cannot be crossed."""
    cells = np.zeros((size, size), np.uint8)
    cells[::20] = cells[:, ::20] = LETHAL
    for y in range(0, size, 20):
        for x in range(0, size, 20):
            gap = int(rng.integers(1, 4))
            if rng.random() < 0.6:
                cells[y, x + 8 : x + 8 + gap] = 0
            if rng.random() < 0.6:
                cells[y + 8 : y + 8 + gap, x] = 0
    return cells


def clutter(rng, size):
    return np.where(rng.random((size, size)) < 0.25, LETHAL, 0).astype(np.uint8)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make", [bumps, walls, rooms_of_thin_walls, clutter])
def test_block_by_block_is_as_cheap_as_the_whole_field(make, seed):
    rng = np.random.default_rng(seed)
    cells = make(rng, 330 + seed)
    open_cells = np.argwhere(cells < INSCRIBED)[:, ::-1]
    for a, b in open_cells[rng.integers(0, len(open_cells), (3, 2))].tolist():
        start, goal = (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))
        times = np.full(cells.shape, np.inf, np.float32)
        limits = np.full([-(-n // potential_kernels.BLOCK) for n in cells.shape], np.inf, np.float32)
        zero = np.zeros(1, np.float32)
        found = potential_kernels.propagate(cells, PRICES, np.array([a]), zero, b[0], b[1], limits, times)
        costs = []

        def descend(field, goal, start, costs=costs):
            costs.append(float(field.times[int(goal[1]), int(goal[0])]))
            return search.descend_smoothly(field, goal, start)

        points = search.find_way(cells, PRICES, start, goal, descend)
        assert (points is not None) == bool(found)
        if points is not None:
            assert points[0].tolist() == pytest.approx(start)
            assert points[-1].tolist() == pytest.approx(goal)
            assert costs[-1] <= times[b[1], b[0]] * 1.005 + 1.0


def test_only_the_blocks_that_are_opened_are_written():
    times = np.full((40, 50), -7.0, np.float32)
    limits = np.full((5, 7), -1.0, np.float32)
    limits[2, 3] = 10.0
    potential_kernels.open_blocks(limits, times)
    expected = np.full((40, 50), -7.0, np.float32)
    expected[8:32, 16:40] = np.inf
    assert (times == expected).all()


def test_no_time_is_kept_beyond_a_blocks_limit():
    cells = np.zeros((32, 32), np.uint8)
    limits = np.full((4, 4), np.inf, np.float32)
    limits[:, 2:] = 1200.0
    limits[3, :] = -1.0
    times = np.full(cells.shape, np.inf, np.float32)
    source, zero = np.array([[4, 4]]), np.zeros(1, np.float32)
    potential_kernels.propagate(cells, PRICES, source, zero, -1, -1, limits, times)
    assert np.isfinite(times[:24, :16]).all()
    kept = times[:24, 16:]
    assert np.isinf(times[24:]).all()
    assert kept[np.isfinite(kept)].max() <= 1200.0
    assert np.isinf(kept).any()


def test_the_price_of_a_line_is_exact():
    cells = np.zeros((5, 20), np.uint8)
    cells[:, 10:] = 100  # from x = 9.5
    price = straighten_kernels.line_price(cells, PRICES, 2.25, 1.0, 14.25, 4.0)
    length = math.hypot(12.0, 3.0)
    share = (9.5 - 2.25) / 12.0
    assert price == pytest.approx(length * (share * 50.0 + (1 - share) * 130.0), rel=1e-6)
    back = straighten_kernels.line_price(cells, PRICES, 14.25, 4.0, 2.25, 1.0)
    assert back == pytest.approx(price, rel=1e-6)


@pytest.mark.parametrize("end", [(3.0, 3.0), (5.0, 5.0)])
def test_a_line_does_not_pass_the_corner_of_an_obstacle(end):
    cells = np.zeros((8, 8), np.uint8)
    assert math.isfinite(straighten_kernels.line_price(cells, PRICES, 2.0, 2.0, *end))
    cells[3, 2] = LETHAL
    assert math.isinf(straighten_kernels.line_price(cells, PRICES, 2.0, 2.0, *end))
    assert math.isinf(straighten_kernels.line_price(cells, PRICES, *end, 2.0, 2.0))


def test_no_line_leaves_the_grid():
    cells = np.zeros((8, 8), np.uint8)
    assert math.isinf(straighten_kernels.line_price(cells, PRICES, 2.0, 2.0, 2.0, 7.6))
    assert math.isinf(straighten_kernels.line_price(cells, PRICES, -0.6, 2.0, 2.0, 2.0))


def test_pulling_keeps_the_ends_and_what_stands_in_the_way():
    cells = np.zeros((30, 30), np.uint8)
    cells[0:15, 15] = LETHAL
    way = np.concatenate(
        [
            np.column_stack((np.full(20, 5.0), np.arange(20.0))),
            np.column_stack((np.arange(5.0, 25.0), np.full(20, 20.0))),
            np.column_stack((np.full(21, 25.0), np.arange(20.0, -1.0, -1.0))),
        ]
    )
    pulled = straighten_kernels.pull(cells, PRICES, way, 100)
    assert pulled[0].tolist() == way[0].tolist()
    assert pulled[-1].tolist() == way[-1].tolist()
    pieces = [straighten_kernels.line_price(cells, PRICES, *a, *b) for a, b in pairwise(pulled)]
    assert sum(pieces) < 0.9 * 50.0 * 60.0
    assert math.isfinite(sum(pieces))


def test_a_way_that_cannot_be_taken_is_left_as_it_is():
    cells = np.zeros((9, 9), np.uint8)
    cells[:, 4] = LETHAL
    way = np.column_stack((np.arange(9.0), np.full(9, 3.0)))
    assert (straighten_kernels.pull(cells, PRICES, way, 5) == way).all()


def test_smoothing_rounds_a_corner_in_the_open_but_not_through_an_obstacle():
    corner = np.concatenate(
        [
            np.column_stack((np.arange(5.0, 15.0, 0.5), np.full(20, 5.0))),
            np.column_stack((np.full(21, 15.0), np.arange(5.0, 15.5, 0.5))),
        ]
    )
    cells = np.zeros((20, 20), np.uint8)
    rounded = straighten_kernels.smooth(cells, PRICES, corner, 4, 1.0)
    assert np.hypot(*(rounded - corner).T).max() > 0.4
    assert rounded[[0, -1]].tolist() == corner[[0, -1]].tolist()
    cells[6:, :15] = LETHAL
    beside = straighten_kernels.smooth(cells, PRICES, corner, 4, 1.0)
    for a, b in pairwise(beside):
        assert math.isfinite(straighten_kernels.line_price(cells, PRICES, *a, *b))
