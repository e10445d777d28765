"""The keep-out mask."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.keepout import KeepoutLayer
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import NoPath
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.registry import make_global_planner

FOOTPRINT = [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]]
ROOM = GridInfo(resolution=0.1, width=40, height=30)
NAMES = ["rosbot_patrol/KeepoutLayer", "rosbot_patrol::KeepoutLayer"]


def make(*, kind=NAMES[0], rolling=False, **keepout):
    tree = {
        "plugins": [
            {"name": "static", "type": "costmap_2d::StaticLayer"},
            {"name": "keepout", "type": kind},
            {"name": "inflation", "type": "costmap_2d::InflationLayer"},
        ],
        "static": {},
        "keepout": keepout,
        "inflation": {"inflation_radius": 0.3},
        "footprint": FOOTPRINT,
        "rolling_window": rolling,
        "width": 4.0,
        "height": 3.0,
    }
    costmap = LayeredCostmap(read_costmap(tree))
    costmap.static_layers[0].set_map(Grid(ROOM, np.zeros(ROOM.shape, np.int8)))
    return costmap


def mask_of(costmap):
    return next(layer for layer in costmap.layers if isinstance(layer, KeepoutLayer))


def mask(*, info=ROOM, x=slice(18, 22), y=slice(0, 30), value=100):
    cells = np.full(info.shape, -1, np.int8)
    cells[y, x] = value
    return Grid(info, cells)


@pytest.mark.parametrize("kind", NAMES)
def test_masked_cells_are_lethal_and_inflated(kind):
    costmap = make(kind=kind)
    mask_of(costmap).set_map(mask())
    costmap.update(0.0, Pose2D(1.0, 1.0))
    assert (costmap.cells[:, 18:22] == 254).all()
    assert (costmap.cells[:, 17] == 253).all()
    assert (costmap.cells[:, :10] == 0).all()


def test_plans_do_not_cross_a_mask():
    costmap = make()
    mask_of(costmap).set_map(mask(y=slice(0, 20)))
    costmap.update(0.0, Pose2D(1.0, 1.0))
    planner = make_global_planner("navfn/NavfnROS", {})
    start, goal = Pose2D(1.0, 1.0), Pose2D(3.0, 1.0)
    path = np.asarray(planner.plan(Grid(costmap.info, costmap.cells.copy()), start, goal))
    assert path[:, 1].max() > 2.0
    mask_of(costmap).set_map(mask())
    costmap.update(1.0, start)
    with pytest.raises(NoPath):
        planner.plan(Grid(costmap.info, costmap.cells.copy()), start, goal)


def test_a_mask_gives_no_size_and_may_lie_anywhere():
    costmap = make()
    coarse = GridInfo(resolution=0.2, width=6, height=5, origin_x=1.0, origin_y=1.0)
    mask_of(costmap).set_map(mask(info=coarse, x=slice(0, 1), y=slice(0, 1)))
    costmap.update(0.0, Pose2D(1.0, 1.0))
    assert costmap.info == ROOM
    assert np.argwhere(costmap.cells == 254).tolist() == [[10, 10], [10, 11], [11, 10], [11, 11]]


def test_a_mask_in_a_rolling_window_stays_in_its_place():
    costmap = make(rolling=True)
    mask_of(costmap).set_map(mask())
    for x in (1.0, 1.5, 2.2, 1.1):
        costmap.update(0.0, Pose2D(x, 1.5))
        for place, cost in ((1.85, 254), (2.15, 254), (1.35, 0)):
            assert costmap.grid.at(place, 1.5) == cost


def test_a_mask_only_raises_costs():
    costmap = make()
    walls = np.zeros(ROOM.shape, np.int8)
    walls[5, 5], walls[6, 6] = 100, -1
    costmap.static_layers[0].set_map(Grid(ROOM, walls))
    mask_of(costmap).set_map(mask(value=0))
    costmap.update(0.0, Pose2D(1.0, 1.0))
    assert (costmap.cells[5, 5], np.count_nonzero(costmap.cells == 254)) == (254, 1)


def test_values_between_become_costs_where_asked():
    costmap = make(trinary_costmap=False)
    mask_of(costmap).set_map(mask(value=50))
    costmap.update(0.0, Pose2D(1.0, 1.0))
    assert set(np.unique(costmap.cells)) == {0, 127}


def test_without_its_mask_a_costmap_is_not_current():
    costmap = make()
    assert not costmap.is_current(0.0)
    mask_of(costmap).set_map(mask())
    assert costmap.is_current(0.0)


def test_another_mask_takes_the_old_ones_place():
    costmap = make()
    for x in (slice(5, 6), slice(30, 31)):
        mask_of(costmap).set_map(mask(x=x))
        costmap.update(0.0, Pose2D(1.0, 1.0))
    assert np.unique(np.argwhere(costmap.cells == 254)[:, 1]).tolist() == [30]
    mask_of(costmap).update_map(30, 0, np.zeros((30, 1), np.int8))
    areas = costmap.update(1.0, Pose2D(1.0, 1.0))
    assert not (costmap.cells == 254).any()
    assert areas == [Bounds(27, 0, 34, 30)]
