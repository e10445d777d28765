"""Cost values against the tables that costmap_2d documents."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.costs import costs_of_occupancy, occupancy_of
from rosbot_patrol.costmap.inflation import cost_at, cost_table


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


@pytest.mark.parametrize("seed", range(5))
def test_inflation_is_exact(seed):
    rng = np.random.default_rng(seed)
    cells = np.zeros((50, 70), np.uint8)
    cells[rng.integers(0, 50, 9), rng.integers(0, 70, 9)] = 254
    cells[rng.integers(0, 50, 30), rng.integers(0, 70, 30)] = 100
    radius = int(rng.integers(1, 20))
    table = cost_table(radius, 0.05, inscribed_radius=0.1, cost_scaling_factor=3.0)
    ys, xs = np.nonzero(cells == 254)
    y, x = np.mgrid[:50, :70]
    d2 = ((y[..., None] - ys) ** 2 + (x[..., None] - xs) ** 2).min(axis=-1)
    expected = np.maximum(cells, np.where(d2 <= radius**2, table[np.minimum(d2, radius**2)], 0))
    inflated = cells.copy()
    kernels.inflate(inflated, 0, 0, 70, 50, radius, table, False)
    assert (inflated == expected).all()


def test_inflation_of_a_part_sees_obstacles_outside_it():
    cells = np.zeros((20, 40), np.uint8)
    cells[10, 10] = 254
    table = cost_table(6, 0.1, inscribed_radius=0.2, cost_scaling_factor=3.0)
    whole, part = cells.copy(), cells.copy()
    kernels.inflate(whole, 0, 0, 40, 20, 6, table, False)
    kernels.inflate(part, 12, 5, 20, 15, 6, table, False)
    assert (part[5:15, 12:20] == whole[5:15, 12:20]).all()
    assert part[10, 11] == 0


def test_unknown_cells_are_inflated_only_by_the_robots_own_radius():
    cells = np.full((1, 9), 255, np.uint8)
    cells[0, 0] = 254
    table = cost_table(8, 0.1, inscribed_radius=0.2, cost_scaling_factor=3.0)
    careful, bold = cells.copy(), cells.copy()
    kernels.inflate(careful, 0, 0, 9, 1, 8, table, False)
    kernels.inflate(bold, 0, 0, 9, 1, 8, table, True)
    assert careful[0].tolist() == [254, 253, 253, 255, 255, 255, 255, 255, 255]
    assert bold[0, 3] == table[9]
