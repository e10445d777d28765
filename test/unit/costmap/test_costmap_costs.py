"""Cost values against the tables that costmap_2d documents."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL, UNKNOWN, costs_of_occupancy, occupancy_of
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layers import inflation_kernels as kernels
from rosbot_patrol.costmap.layers.inflation import InflationLayer, cost_at, cost_table
from rosbot_patrol.costmap.params import InflationParams
from rosbot_patrol.grid import GridInfo


@pytest.mark.parametrize(("cost", "shown"), [(0, 0), (1, 1), (252, 98), (253, 99), (254, 100), (255, -1)])
def test_costs_are_shown_as_upstream_does(cost, shown):
    assert occupancy_of(np.array([cost], np.uint8))[0] == shown


def test_costs_between_are_shown_monotonously():
    assert (np.diff(occupancy_of(np.arange(1, 253, dtype=np.uint8)).astype(int)) >= 0).all()


def test_a_map_is_free_lethal_or_unknown():
    cells = np.array([0, 50, 99, 100, -1], np.int8)
    assert costs_of_occupancy(cells).tolist() == [0, 0, 0, 254, 255]
    assert costs_of_occupancy(cells, track_unknown=False).tolist() == [0, 0, 0, 254, 0]


def test_a_map_that_is_not_trinary_is_scaled():
    cells = np.array([0, 50, 65, 100], np.int8)
    assert costs_of_occupancy(cells, trinary=False, lethal_threshold=65).tolist() == [0, int(50 / 65 * 254), 254, 254]


def test_cost_decays_from_the_inscribed_radius():
    def cost(d):
        return cost_at(d, inscribed_radius=0.2, cost_scaling_factor=10.0)

    assert (cost(0.0), cost(0.1), cost(0.2)) == (254, 253, 253)
    assert cost(0.3) == int(252 * math.exp(-1.0))


def inflate(cells, x0, y0, x1, y1, radius, table, inflate_unknown):
    """Both kernels, which have to agree."""
    padded = np.zeros(65536, np.uint8)
    padded[: len(table)] = table
    far, floor = cells.copy(), 1 if inflate_unknown else INSCRIBED
    kernels.inflate_far(far, far, x0, y0, x1, y1, radius, table, floor)
    kernels.inflate(cells, cells, x0, y0, x1, y1, radius, padded, floor)
    assert np.array_equal(cells, far)


def scattered(rng, shape, lethal, others):
    cells = np.zeros(shape, np.uint8)
    cells[rng.integers(0, shape[0], others), rng.integers(0, shape[1], others)] = 100
    cells[rng.integers(0, shape[0], others), rng.integers(0, shape[1], others)] = UNKNOWN
    cells[rng.integers(0, shape[0], lethal), rng.integers(0, shape[1], lethal)] = LETHAL
    return cells


@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("radius", [1, 2, 7, 15, 16, 17, 33, 63])
def test_inflation_is_exact(radius, unknown):
    rng = np.random.default_rng(radius)
    cells = scattered(rng, (50, 150), 7, 300)
    table = cost_table(radius, 0.05, inscribed_radius=0.1, cost_scaling_factor=1.5)
    ys, xs = np.nonzero(cells == LETHAL)
    y, x = np.mgrid[:50, :150]
    d2 = ((y[..., None] - ys) ** 2 + (x[..., None] - xs) ** 2).min(axis=-1)
    cost = np.where(d2 <= radius**2, table[np.minimum(d2, radius**2)], 0)
    over_unknown = np.where(cost >= (1 if unknown else INSCRIBED), cost, UNKNOWN)
    expected = np.where(cells == UNKNOWN, over_unknown, np.maximum(cells, cost))
    inflate(cells, 0, 0, 150, 50, radius, table, unknown)
    assert np.array_equal(cells, expected)


@pytest.mark.parametrize(("radius", "lethal"), [(254, 1), (254, 40), (250, 0), (100, 4000)])
def test_wide_inflation_is_exact_by_opencvs_distances(radius, lethal):
    rng = np.random.default_rng(lethal)
    cells = scattered(rng, (700, 900), lethal, 0)
    table = cost_table(radius, 0.01, inscribed_radius=0.13, cost_scaling_factor=1.0)
    expected = cells.copy()
    if lethal:
        d = cv2.distanceTransform((cells != LETHAL).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        d2 = np.rint(d.astype(np.float64) ** 2).astype(np.int64)
        expected = np.where(d2 <= radius**2, table[np.minimum(d2, radius**2)], 0)
    inflate(cells, 0, 0, 900, 700, radius, table, False)
    assert np.array_equal(cells, expected)


def test_a_reach_beyond_the_fast_kernels_is_inflated():
    layer = InflationLayer(InflationParams(inflation_radius=3.0, cost_scaling_factor=0.1))
    layer.match(GridInfo(resolution=0.01, width=400, height=3), Footprint.of([], robot_radius=0.1, padding=0.0))
    cells = np.zeros((3, 400), np.uint8)
    cells[1, 0] = LETHAL
    layer.update_costs(cells, Bounds(0, 0, 400, 3))
    assert layer.reach == 300
    assert cells[1, 300] == int(252 * math.exp(-0.1 * (3.0 - 0.1 * math.cos(math.pi / 16))))
    assert cells[1, 301] == 0


def test_inflation_of_a_part_sees_obstacles_outside_it():
    cells = np.zeros((20, 40), np.uint8)
    cells[10, 10] = 254
    table = cost_table(6, 0.1, inscribed_radius=0.2, cost_scaling_factor=3.0)
    whole, part = cells.copy(), cells.copy()
    inflate(whole, 0, 0, 40, 20, 6, table, False)
    inflate(part, 12, 5, 20, 15, 6, table, False)
    assert (part[5:15, 12:20] == whole[5:15, 12:20]).all()
    assert part[10, 11] == 0


def test_unknown_cells_are_inflated_only_by_the_robots_own_radius():
    cells = np.full((1, 9), 255, np.uint8)
    cells[0, 0] = 254
    table = cost_table(8, 0.1, inscribed_radius=0.2, cost_scaling_factor=3.0)
    careful, bold = cells.copy(), cells.copy()
    inflate(careful, 0, 0, 9, 1, 8, table, False)
    inflate(bold, 0, 0, 9, 1, 8, table, True)
    assert careful[0].tolist() == [254, 253, 253, 255, 255, 255, 255, 255, 255]
    assert bold[0, 3] == table[9]
