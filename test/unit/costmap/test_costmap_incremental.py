"""An update computes only what changed: the result must be that of computing everything, cell for cell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.bounds import Bounds, merged
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.obstacle import observe
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.costmap.scrolling import ScrollingCells, strips
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

STATIC = {"name": "static", "type": "costmap_2d::StaticLayer"}
OBSTACLES = {"name": "obstacles", "type": "costmap_2d::ObstacleLayer"}
MORE = {"name": "more", "type": "costmap_2d::ObstacleLayer"}
INFLATION = {"name": "inflation", "type": "costmap_2d::InflationLayer"}
KEEPOUT = {"name": "keepout", "type": "rosbot_patrol/KeepoutLayer"}
ORDERS = {
    "obstacles": [OBSTACLES, INFLATION],
    "static": [STATIC, OBSTACLES, INFLATION],
    "keepout": [STATIC, KEEPOUT, OBSTACLES, INFLATION],
    "inflation first": [INFLATION, OBSTACLES],
    "inflation between": [STATIC, INFLATION, OBSTACLES],
    "inflated twice": [STATIC, INFLATION, OBSTACLES, MORE, INFLATION | {"name": "again"}],
}


def make(plugins, *, rolling, unknown=False, method=1, inflation=None):
    source = {
        "data_type": "LaserScan",
        "topic": "scan",
        "clearing": True,
        "obstacle_range": 2.0,
        "raytrace_range": 2.5,
        "observation_persistence": 0.2,
    }
    layer = {"observation_sources": "scan", "scan": source, "combination_method": method}
    forgetful = {**layer, "forget_unseen_after": 0.3, "forget_out_of_view_after": 1.0}
    given = {
        "static": {},
        "keepout": {},
        "obstacles": layer,
        "more": forgetful,
        "inflation": inflation or {"inflation_radius": 0.7, "cost_scaling_factor": 1.0},
        "again": {"inflation_radius": 0.3, "cost_scaling_factor": 3.0},
    }
    tree = {
        "plugins": plugins,
        **{plugin["name"]: given[plugin["name"]] for plugin in plugins},
        "rolling_window": rolling,
        "track_unknown_space": unknown,
        "width": 3.0,
        "height": 2.6,
        "resolution": 0.05,
        "footprint": [[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]],
    }
    costmap = LayeredCostmap(read_costmap(tree))
    rng = np.random.default_rng(7)
    cells = rng.choice(np.array([0, 100, -1], np.int8), (70, 80), p=[0.97, 0.02, 0.01])
    for layer in costmap.static_layers:
        layer.set_map(Grid(GridInfo(resolution=0.05, width=80, height=70, origin_x=-2.0, origin_y=-1.7), cells))
    return costmap


def scan_of(rng, stamp):
    ranges = 1.2 + 0.6 * np.sin(np.arange(90) * 0.3) + rng.normal(0.0, 0.03, 90)
    ranges[rng.integers(0, 90, 12)] = np.inf
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / 90,
        range_min=0.1,
        range_max=5.0,
        ranges=ranges,
    )


def from_scratch(costmap):
    """The master computed anew from what the layers hold."""
    cells = np.full_like(costmap.cells, 255 if costmap.params.track_unknown_space else 0)
    whole = Bounds(0, 0, cells.shape[1], cells.shape[0])
    for layer in costmap.layers:
        if not layer.enabled:
            continue
        kept = getattr(layer, "_source", None)
        if kept is not None:
            layer._source = ScrollingCells(*cells.shape, 0)
            layer.take_sources(cells, [whole])
        layer.update_costs(cells, whole)
        if kept is not None:
            layer._source = kept
    return cells


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("rolling", [True, False])
def test_an_update_is_exact(order, rolling):
    rng = np.random.default_rng(len(order))
    costmap = make(ORDERS[order], rolling=rolling, unknown=order == "keepout", method=0 if order == "static" else 1)
    pose = Pose2D()
    for step in range(30):
        now = 0.1 * step
        if step % 3:
            turn = rng.uniform(-1.0, 1.0)
            pose = Pose2D(pose.x + rng.uniform(-0.15, 0.2), pose.y + rng.uniform(-0.1, 0.1), pose.yaw + turn)
        if step % 5 < 2:
            for layer in costmap.obstacle_layers:
                layer.buffers["scan"].add(observe(scan_of(rng, now), pose))
        before, info = costmap.cells.copy(), costmap.info
        areas = costmap.update(now, pose)
        assert np.array_equal(costmap.cells, from_scratch(costmap)), step
        if costmap.info == info:
            untouched = np.ones(before.shape, bool)
            for area in areas:
                untouched[area.y0 : area.y1, area.x0 : area.x1] = False
            assert np.array_equal(costmap.cells[untouched], before[untouched])


@pytest.mark.parametrize("spread", [{"inflation_radius": 2.0, "cost_scaling_factor": 0.5}, {"inflation_radius": 0.0}])
def test_an_update_is_exact_whatever_the_reach(spread):
    rng = np.random.default_rng(3)
    costmap = make(ORDERS["obstacles"], rolling=True, inflation=spread)
    for step in range(12):
        pose = Pose2D(0.11 * step, -0.07 * step, 0.2 * step)
        costmap.obstacle_layers[0].buffers["scan"].add(observe(scan_of(rng, 0.1 * step), pose))
        costmap.update(0.1 * step, pose)
        assert np.array_equal(costmap.cells, from_scratch(costmap)), step


def test_a_scan_like_the_last_one_changes_nothing():
    costmap = make(ORDERS["obstacles"], rolling=True)
    for stamp in (0.0, 0.5):
        costmap.obstacle_layers[0].buffers["scan"].add(observe(scan_of(np.random.default_rng(1), stamp), Pose2D()))
        areas = costmap.update(stamp, Pose2D())
    assert areas == []


def test_what_changed_is_told_tightly():
    costmap = make(ORDERS["obstacles"], rolling=True)
    for stamp, extra in ((0.0, 1.0), (0.5, 1.5)):
        scan = scan_of(np.random.default_rng(1), stamp)
        scan.ranges[45] = extra  # straight ahead
        costmap.obstacle_layers[0].buffers["scan"].add(observe(scan, Pose2D(0.01, 0.01)))
        areas = costmap.update(stamp, Pose2D(0.01, 0.01))
    (x0, y), (x1, _) = costmap.info.cell_of(1.01, 0.01), costmap.info.cell_of(1.51, 0.01)
    reach = 14  # 0.7 m
    (area,) = areas
    assert area == Bounds(x0 - reach, y - reach, x1 + 1 + reach, y + 1 + reach).clipped(60, 52)


def test_other_parameters_of_the_inflation_are_taken_at_run_time():
    costmap = make(ORDERS["static"], rolling=False)
    costmap.update(0.0, Pose2D())
    layer = costmap.layers[-1]
    layer.configure(type(layer.params)(inflation_radius=0.2))
    costmap.update(0.1, Pose2D())
    assert np.array_equal(costmap.cells, from_scratch(costmap))
    layer.enabled = False
    costmap.update(0.2, Pose2D())
    assert set(np.unique(costmap.cells)) <= {0, 254}


@pytest.mark.parametrize("seed", range(4))
def test_a_scrolling_window_keeps_what_stays(seed):
    rng = np.random.default_rng(seed)
    window = ScrollingCells(40, 30, 9)
    expected = np.full((40, 30), 9, np.uint8)
    for _ in range(200):
        window.cells[:] = expected
        dx, dy = (int(v) for v in rng.integers(-6, 9, 2) * (20 if rng.random() < 0.03 else 1))
        window.shift(dx, dy)
        moved = np.full((40 + 400, 30 + 400), 9, np.uint8)
        moved[200:240, 200:230] = expected
        expected = moved[200 + dy : 240 + dy, 200 + dx : 230 + dx].copy()
        assert np.array_equal(window.cells, expected)
        assert window.cells.flags.c_contiguous
        expected[rng.integers(0, 40, 5), rng.integers(0, 30, 5)] = rng.integers(0, 255, 5)


def test_rectangles_that_overlap_are_cut_or_joined():
    rng = np.random.default_rng(0)
    for _ in range(50):
        low = rng.integers(0, 40, (6, 2))
        areas = [Bounds(*a.tolist(), *(a + rng.integers(0, 25, 2)).tolist()) for a in low]
        hit = np.zeros((70, 70), int)
        for area in merged(areas):
            hit[area.y0 : area.y1, area.x0 : area.x1] += 1
        assert hit.max(initial=0) <= 1
        for area in areas:
            assert (hit[area.y0 : area.y1, area.x0 : area.x1] == 1).all()


def test_what_comes_into_a_window_in_both_directions_is_no_square():
    came = merged(strips(3500, 3500, 10, 10))
    assert sum(area.size for area in came) == 2 * 10 * 3500 - 100


def something_else_happens(rng, costmap, pose):
    chance = rng.random()
    if chance < 0.03:
        costmap.reset()
    elif chance < 0.06:
        costmap.clear_outside(pose, 1.0)
    elif chance < 0.09:
        layer = costmap.layers[int(rng.integers(len(costmap.layers)))]
        if layer not in costmap.static_layers:
            layer.enabled = not layer.enabled
    elif chance < 0.13 and costmap.static_layers:
        part = rng.choice(np.array([0, 100, -1], np.int8), (5, 6))
        costmap.static_layers[-1].update_map(int(rng.integers(0, 70)), int(rng.integers(0, 60)), part)


# The last four of 22,000 found the inflation of a cell that left the window while a later layer hid it.
@pytest.mark.parametrize("seed", [*range(30), 5584, 17560, 19738, 21826])
def test_random_drives_are_exact(seed):
    rng = np.random.default_rng(seed)
    plugins = ORDERS[list(ORDERS)[seed % 6]]
    rolling, unknown, method = (int(rng.integers(2)) for _ in range(3))
    spread = {
        "inflation_radius": float(rng.uniform(0.0, 1.6)),
        "cost_scaling_factor": float(rng.choice([0.1, 1, 3, 10])),
        "inflate_unknown": bool(rng.integers(2)),
    }
    costmap = make(plugins, rolling=bool(rolling), unknown=bool(unknown), method=method, inflation=spread)
    pose = Pose2D()
    for step in range(25):
        if rng.random() < 0.6:
            leap = rng.normal(0.0, 0.2) * (8 if rng.random() < 0.05 else 1)
            pose = Pose2D(pose.x + leap, pose.y + rng.normal(0.0, 0.2), pose.yaw + rng.uniform(-1.0, 1.0))
        if rng.random() < 0.5:
            for layer in costmap.obstacle_layers:
                layer.buffers["scan"].add(observe(scan_of(rng, 0.1 * step), pose))
        something_else_happens(rng, costmap, pose)
        costmap.update(0.1 * step, pose)
        assert np.array_equal(costmap.cells, from_scratch(costmap)), step
