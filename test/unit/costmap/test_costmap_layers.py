"""Layers alone and together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.bounds import Bounds, merged
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import observe
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

FOOTPRINT = [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]]


def make(**changes):
    tree = {
        "plugins": [{"name": "obstacles", "type": "costmap_2d::ObstacleLayer"}],
        "obstacles": {
            "observation_sources": "scan",
            "scan": {
                "data_type": "LaserScan",
                "clearing": True,
                "obstacle_range": 3.0,
                "raytrace_range": 4.0,
                **changes.pop("source", {}),
            },
        },
        "rolling_window": True,
        "width": 4.0,
        "height": 4.0,
        "resolution": 0.1,
        "footprint": FOOTPRINT,
        "footprint_padding": 0.0,
        **changes,
    }
    return LayeredCostmap(read_costmap(tree))


def one_beam(length, *, stamp=0.0, angle=0.0):
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=angle,
        angle_increment=0.01,
        range_min=0.1,
        range_max=10.0,
        ranges=np.array([length]),
    )


HERE = Pose2D(0.05, 0.05)


def see(costmap, length, *, pose=HERE, now=0.0, inf_is_valid=False):
    layer = costmap.obstacle_layers[0]
    layer.buffers["scan"].add(observe(one_beam(length, stamp=now), pose, inf_is_valid=inf_is_valid))
    costmap.update(now, pose)


def test_a_hit_is_marked():
    costmap = make()
    see(costmap, 1.0)
    assert costmap.grid.at(1.05, 0.05) == 254
    assert (costmap.cells == 254).sum() == 1


def test_an_obstacle_that_has_gone_is_cleared():
    costmap = make()
    see(costmap, 1.0)
    see(costmap, 1.7, now=0.1)
    assert costmap.grid.at(1.05, 0.05) == 0
    assert costmap.grid.at(1.75, 0.05) == 254


def test_a_beam_without_a_hit_clears_only_where_it_is_valid():
    for valid in (False, True):
        costmap = make(source={"inf_is_valid": valid})
        see(costmap, 1.0)
        see(costmap, np.inf, now=0.1, inf_is_valid=valid)
        assert costmap.grid.at(1.05, 0.05) == (0 if valid else 254)


def test_a_hit_beyond_the_obstacle_range_clears_and_is_not_marked():
    costmap = make(source={"obstacle_range": 1.5})
    see(costmap, 1.0)
    see(costmap, 1.7, now=0.1)
    assert (costmap.cells == 254).sum() == 0


def test_nothing_is_cleared_beyond_the_raytrace_range():
    costmap = make()
    see(costmap, 1.5)
    costmap.obstacle_layers[0].buffers["scan"].params.__dict__["raytrace_range"] = 1.0
    see(costmap, 1.9, now=0.1)
    assert costmap.grid.at(1.55, 0.05) == 254


def test_minus_inf_means_too_near_and_clears_nothing():
    costmap = make(source={"inf_is_valid": True})
    see(costmap, 1.0)
    see(costmap, -np.inf, now=0.1, inf_is_valid=True)
    assert costmap.grid.at(1.05, 0.05) == 254


def test_the_robots_own_cells_are_free():
    costmap = make()
    see(costmap, 1.0)
    costmap.obstacle_layers[0].buffers["scan"].clear()
    costmap.update(0.1, Pose2D(1.05, 0.05))
    assert costmap.grid.at(1.05, 0.05) == 0


def test_a_rolling_window_keeps_what_it_saw():
    costmap = make()
    see(costmap, 1.0)
    costmap.obstacle_layers[0].buffers["scan"].clear()
    costmap.update(0.1, Pose2D(-0.55, 0.35))
    assert costmap.grid.at(1.05, 0.05) == 254
    assert (costmap.cells == 254).sum() == 1
    assert costmap.info.origin_x == pytest.approx(-2.5, abs=0.11)


def test_inflation_reaches_into_the_strip_that_comes_in():
    plugins = [
        {"name": "obstacles", "type": "costmap_2d::ObstacleLayer"},
        {"name": "inflation", "type": "costmap_2d::InflationLayer"},
    ]
    costmap = make(plugins=plugins, inflation={"inflation_radius": 0.6, "cost_scaling_factor": 1.0})
    see(costmap, 1.9)
    costmap.obstacle_layers[0].buffers["scan"].clear()
    costmap.update(0.1, Pose2D(0.35, 0.05))
    assert costmap.grid.at(2.25, 0.05) > 0


def test_stale_input_is_told():
    costmap = make(source={"expected_update_rate": 0.5})
    assert not costmap.is_current(0.0)
    see(costmap, 1.0, now=1.0)
    assert costmap.is_current(1.4)
    assert not costmap.is_current(1.6)


def test_clearing_keeps_what_is_near():
    costmap = make()
    see(costmap, 1.5)
    costmap.obstacle_layers[0].buffers["scan"].clear()
    see(costmap, 0.5, now=0.1, pose=Pose2D(0.05, 0.05, math.pi / 2))
    costmap.obstacle_layers[0].buffers["scan"].clear()
    costmap.clear_outside(Pose2D(0.05, 0.05), 2.0)
    costmap.update(0.2, Pose2D(0.05, 0.05))
    assert costmap.grid.at(0.05, 0.55) == 254
    assert costmap.grid.at(1.55, 0.05) == 0


def static_map(frame_shift=0.0):
    cells = np.zeros((30, 40), np.int8)
    cells[10, 20] = 100
    cells[:, 0] = -1
    return Grid(GridInfo(resolution=0.1, width=40, height=30, origin_x=-1.0 + frame_shift, origin_y=-1.0), cells)


def test_the_master_takes_the_maps_place_and_size():
    tree = {"plugins": [{"name": "static", "type": "costmap_2d::StaticLayer"}], "footprint": FOOTPRINT}
    costmap = LayeredCostmap(read_costmap(tree))
    assert not costmap.is_current(0.0)
    costmap.static_layers[0].set_map(static_map())
    costmap.update(0.0, Pose2D())
    assert costmap.info == static_map().info
    assert costmap.cells[10, 20] == 254
    assert (costmap.cells[:, 0] == 255).all()
    assert costmap.is_current(0.0)


def test_a_map_update_changes_a_part_and_what_lies_outside_is_ignored():
    tree = {"plugins": [{"name": "static", "type": "costmap_2d::StaticLayer"}], "footprint": FOOTPRINT}
    costmap = LayeredCostmap(read_costmap(tree))
    layer = costmap.static_layers[0]
    layer.set_map(static_map())
    costmap.update(0.0, Pose2D())
    layer.update_map(38, 28, np.full((5, 5), 100, np.int8))
    layer.update_map(100, 100, np.full((5, 5), 100, np.int8))
    areas = costmap.update(0.1, Pose2D())
    assert areas == [Bounds(38, 28, 40, 30)]
    assert (costmap.cells[28:, 38:] == 254).all()


def test_a_rolling_costmap_samples_the_map_where_it_lies():
    costmap = make(plugins=[{"name": "static", "type": "costmap_2d::StaticLayer"}])
    costmap.static_layers[0].set_map(static_map())
    costmap.static_layers[0].master_from_map = Pose2D(0.2, 0.0, math.pi / 2)
    costmap.update(0.0, Pose2D())
    # the lethal cell's centre is (1.05, 0.05) in the map, so (0.15, 1.05) here
    assert costmap.grid.at(0.15, 1.05) == 254


def test_layers_work_in_the_configured_order():
    plugins = [
        {"name": "inflation", "type": "costmap_2d::InflationLayer"},
        {"name": "obstacles", "type": "costmap_2d::ObstacleLayer"},
    ]
    costmap = make(plugins=plugins)
    see(costmap, 1.0)
    assert set(np.unique(costmap.cells)) == {0, 254}  # inflated before there was anything to inflate
    assert costmap.circumscribed_cost == 0


def test_areas_that_overlap_are_merged():
    areas = merged([Bounds(0, 0, 5, 5), Bounds(10, 10, 12, 12), Bounds(4, 4, 6, 6), Bounds(3, 3, 3, 9)])
    assert sorted(areas) == [Bounds(0, 0, 6, 6), Bounds(10, 10, 12, 12)]


def test_the_same_map_again_changes_nothing_and_a_corrected_one_only_what_differs():
    tree = {"plugins": [{"name": "static", "type": "costmap_2d::StaticLayer"}], "footprint": FOOTPRINT}
    costmap = LayeredCostmap(read_costmap(tree))
    layer = costmap.static_layers[0]
    for _ in range(2):
        layer.set_map(static_map())
        areas = costmap.update(0.0, Pose2D())
    assert areas == []
    corrected = static_map()
    corrected.cells[12, 5], corrected.cells[14, 9] = 100, 100
    layer.set_map(corrected)
    assert costmap.update(0.0, Pose2D()) == [Bounds(5, 12, 10, 15)]
    assert costmap.cells[14, 9] == 254
