"""Costmaps against costmap_2d's documented rules (navigation 1.17, Noetic), cell for cell.

Each test names where upstream says so: the wiki (http://wiki.ros.org/costmap_2d and its pages for each layer) or
the source file and function.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap import costmap_kernels as kernels
from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import costs_of_occupancy, occupancy_of
from rosbot_patrol.costmap.footprint import Footprint
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.layers.inflation import InflationLayer
from rosbot_patrol.costmap.layers.obstacle import observe
from rosbot_patrol.costmap.params import InflationParams, read_costmap
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

FREE, INSCRIBED, LETHAL, UNKNOWN = 0, 253, 254, 255
SQUARE = [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]]
HERE = Pose2D(0.05, 0.05)


def scan(*beams, stamp=0.0, range_max=10.0):
    """Beams (angle in degrees, length)."""
    ranges = np.full(360, np.nan)
    for angle, length in beams:
        ranges[angle] = length
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=math.radians(1.0),
        range_min=0.1,
        range_max=range_max,
        ranges=ranges,
    )


def obstacle_map(*, layer=None, source=None, **costmap):
    """A window of 6 x 6 m at 0.1 m with an obstacle layer."""
    tree = {
        "plugins": [{"name": "obstacles", "type": "costmap_2d::ObstacleLayer"}],
        "obstacles": {
            "observation_sources": "scan",
            "scan": {"data_type": "LaserScan", "clearing": True, **(source or {})},
            **(layer or {}),
        },
        "origin_x": -3.0,
        "origin_y": -3.0,
        "width": 6.0,
        "height": 6.0,
        "resolution": 0.1,
        "footprint": SQUARE,
        **costmap,
    }
    return LayeredCostmap(read_costmap(tree))


def see(costmap, *beams, now=0.0, height=0.1):
    buffer = costmap.obstacle_layers[0].buffers["scan"]
    valid = buffer.params.inf_is_valid
    buffer.add(observe(scan(*beams, stamp=now), HERE, inf_is_valid=valid, height=height))
    costmap.update(now, HERE)


# ---- inflation


@pytest.mark.parametrize(
    ("factor", "costs"),
    [
        (10.0, {0: 254, 1: 253, 2: 253, 3: 92, 4: 34, 5: 12, 6: 4, 7: 1, 8: 0}),
        (1.0, {0: 254, 1: 253, 2: 253, 3: 228, 4: 206, 5: 186, 8: 138, 9: 125, 10: 113, 11: 0}),
    ],
)
def test_costs_decay_with_the_distance(factor, costs):
    """inflation_layer.h, computeCost: 254 at 0, 253 within the inscribed radius, then 252 e^(-factor (d - inscribed)).

    The wiki gives the same formula under cost_scaling_factor; beyond inflation_radius nothing is written.
    """
    layer = InflationLayer(InflationParams(inflation_radius=1.0, cost_scaling_factor=factor))
    corners = [[0.2, 0.2], [0.2, -0.2], [-0.2, -0.2], [-0.2, 0.2]]
    layer.match(
        GridInfo(resolution=0.1, width=30, height=30),
        Footprint.of(corners, robot_radius=1.0, padding=0.0),
    )
    cells = np.zeros((30, 30), np.uint8)
    cells[15, 15] = LETHAL
    layer.update_costs(cells, Bounds(0, 0, 30, 30))
    for distance, cost in costs.items():
        around = cells[15, 15 + distance], cells[15, 15 - distance], cells[15 + distance, 15], cells[15 - distance, 15]
        assert set(around) == {cost}, distance
    diagonal = math.hypot(0.3, 0.4)
    assert cells[15 + 3, 15 - 4] == int(252 * math.exp(-factor * (diagonal - 0.2)))


@pytest.mark.parametrize(
    ("inflate_unknown", "seen"), [(False, [254, 253, 253, 255, 255]), (True, [254, 253, 253, 92, 34])]
)
def test_unknown_cells_in_the_inflation(inflate_unknown, seen):
    """inflation_layer.cpp, updateCosts: an unknown cell takes a cost from 253 on, with inflate_unknown any above 0."""
    layer = InflationLayer(InflationParams(inflation_radius=1.0, inflate_unknown=inflate_unknown))
    info = GridInfo(resolution=0.1, width=20, height=1)
    layer.match(info, Footprint.of(SQUARE, robot_radius=1.0, padding=0.1))
    cells = np.full((1, 20), UNKNOWN, np.uint8)
    cells[0, 0] = LETHAL
    layer.update_costs(cells, Bounds(0, 0, 20, 1))
    assert cells[0, :5].tolist() == seen
    assert set(cells[0, 8:]) == {UNKNOWN}


def test_inflation_never_lowers_a_cost():
    """inflation_layer.cpp, updateCosts: the greater of the old and the new cost."""
    layer = InflationLayer(InflationParams(inflation_radius=1.0))
    info = GridInfo(resolution=0.1, width=20, height=1)
    layer.match(info, Footprint.of([], robot_radius=0.1, padding=0.0))
    cells = np.full((1, 20), 200, np.uint8)
    cells[0, 0] = LETHAL
    layer.update_costs(cells, Bounds(0, 0, 20, 1))
    assert cells[0, 5:].tolist() == [200] * 15


def test_the_radius_is_rounded_up_to_whole_cells():
    """costmap_2d.cpp, cellDistance: ceil(distance / resolution)."""
    layer = InflationLayer(InflationParams(inflation_radius=0.41, cost_scaling_factor=1.0))
    layer.match(GridInfo(resolution=0.1, width=20, height=1), Footprint.of([], robot_radius=0.1, padding=0.0))
    cells = np.zeros((1, 20), np.uint8)
    cells[0, 0] = LETHAL
    layer.update_costs(cells, Bounds(0, 0, 20, 1))
    assert np.flatnonzero(cells[0]).max() == 5


def test_circumscribed_cost_is_the_cost_at_the_circumscribed_radius():
    """wiki, Inflation: "possibly circumscribed" cost; move_base's planners ask computeCost for it."""
    plugins = [{"name": "inflation", "type": "costmap_2d::InflationLayer"}]
    tree = {"plugins": plugins, "inflation": {}, "footprint": SQUARE, "footprint_padding": 0.0}
    costmap = LayeredCostmap(read_costmap(tree))
    assert costmap.footprint.inscribed_radius == pytest.approx(0.1)
    assert costmap.circumscribed_cost == int(252 * math.exp(-10.0 * (math.hypot(0.1, 0.1) - 0.1)))


# ---- values and maps


def test_costs_as_an_occupancy_grid():
    """costmap_2d_publisher.cpp, cost_translation_table."""
    shown = occupancy_of(np.arange(256, dtype=np.uint8)).astype(int)
    assert (shown[0], shown[253], shown[254], shown[255]) == (0, 99, 100, -1)
    assert shown[1:253].tolist() == [1 + (97 * (i - 1)) // 251 for i in range(1, 253)]
    assert (shown[1], shown[252]) == (1, 98)


@pytest.mark.parametrize("track_unknown", [True, False])
@pytest.mark.parametrize("trinary", [True, False])
@pytest.mark.parametrize("threshold", [100, 65, 0, 200])
def test_a_map_as_costs(threshold, trinary, track_unknown):
    """static_layer.cpp, interpretValue, and onInitialize: the threshold is kept within 0 and 100."""
    clamped = min(threshold, 100)

    def rule(value):
        if value == 255:
            return UNKNOWN if track_unknown else FREE
        if value >= clamped:
            return LETHAL
        return FREE if trinary else int(value / clamped * LETHAL)

    occupancy = np.concatenate((np.arange(0, 101), [-1])).astype(np.int8)
    costs = costs_of_occupancy(occupancy, lethal_threshold=threshold, trinary=trinary, track_unknown=track_unknown)
    assert costs.tolist() == [rule(int(v) & 255) for v in occupancy]


def test_another_value_can_mean_unknown():
    """static_layer.cpp, interpretValue: unknown_cost_value comes before the threshold; -1 is then lethal (255)."""
    costs = costs_of_occupancy(np.array([100, -1, 0], np.int8), unknown_value=100)
    assert costs.tolist() == [UNKNOWN, LETHAL, FREE]


def test_static_maps_by_their_parameters():
    """static_layer.cpp, incomingMap: first_map_only; the size of a costmap that does not roll is the map's."""
    info = GridInfo(resolution=0.05, width=4, height=3, origin_x=1.0, origin_y=2.0)
    other = GridInfo(resolution=0.1, width=7, height=5)
    for first_only in (True, False):
        tree = {"plugins": [{"name": "m", "type": "costmap_2d::StaticLayer"}], "m": {"first_map_only": first_only}}
        costmap = LayeredCostmap(read_costmap(tree))
        for place in (info, other):
            costmap.static_layers[0].set_map(Grid(place, np.zeros(place.shape, np.int8)))
            costmap.update(0.0, Pose2D())
        assert costmap.info == (info if first_only else other)


# ---- layers together

VALUES = np.array([0, 1, 128, 253, 254, 255], np.uint8)


@pytest.mark.parametrize(
    ("merge", "rule"),
    [
        (kernels.merge_max, lambda m, v: m if v == 255 or (m != 255 and m >= v) else v),
        (kernels.merge_over, lambda m, v: m if v == 255 else v),
    ],
)
def test_layers_are_combined(merge, rule):
    """costmap_layer.cpp, updateWithMax and updateWithOverwrite: the layer's unknown cells are skipped."""
    master, layer = (np.ascontiguousarray(v) for v in np.meshgrid(VALUES, VALUES))
    expected = [[rule(int(m), int(v)) for m, v in zip(*rows, strict=True)] for rows in zip(master, layer, strict=True)]
    merge(master, layer, 0, 0, 6, 6)
    assert master.tolist() == expected


@pytest.mark.parametrize(("method", "seen"), [(0, LETHAL), (1, LETHAL), (2, FREE), (99, FREE), (-1, FREE)])
def test_the_combination_method_is_the_layers(method, seen):
    """obstacle_layer.cpp, updateCosts: 0 overwrites, 1 takes the maximum, anything else writes nothing."""
    costmap = obstacle_map(layer={"combination_method": method})
    see(costmap, (0, 1.0))
    assert costmap.grid.at(1.05, 0.05) == seen


def test_layers_work_in_the_order_of_plugins():
    """layered_costmap.cpp, updateMap: inflation before the obstacles inflates nothing (the tutorial of April 2021)."""
    names = [("i", "costmap_2d::InflationLayer"), ("obstacles", "costmap_2d::ObstacleLayer")]
    for order, costs in ((names, 2), (names[::-1], 9)):
        plugins = [{"name": name, "type": kind} for name, kind in order]
        costmap = obstacle_map(plugins=plugins, i={"inflation_radius": 0.5})
        for step in range(3):  # also not when marks are there from the time before
            see(costmap, (0, 1.0 + 0.1 * step), now=float(step))
        assert len(np.unique(costmap.cells)) >= costs if costs > 2 else set(np.unique(costmap.cells)) == {0, 254}


@pytest.mark.parametrize(
    ("x", "cells"),
    [(0.0, 0), (0.024, 0), (0.074, 0), (0.076, 1), (0.174, 1), (0.176, 2), (-0.124, 0), (-0.126, -1), (1.03, 10)],
)
def test_a_rolling_window_moves_by_whole_cells(x, cells):
    """layered_costmap.cpp, updateMap and Costmap2D::updateOrigin, getSizeInMetersX.

    The window wants to start at x - size / 2, where size ends at the centre of the last cell, and moves by that
    difference in cells, cut towards 0: 1.975 m either side of the robot here, from an origin of -2 m.
    """
    costmap = obstacle_map(rolling_window=True, origin_x=-2.0, origin_y=-2.0, width=4.0, height=4.0)
    assert costmap.info.origin_x == -2.0
    costmap.update(0.0, Pose2D(x, 0.0))
    assert costmap.info.origin_x == pytest.approx(-2.0 + 0.1 * cells)


def test_the_size_in_cells_is_cut():
    """costmap_2d_ros.cpp, reconfigureCB: (unsigned int)(width / resolution)."""
    costmap = obstacle_map(width=1.09, height=0.3)
    assert (costmap.info.width, costmap.info.height) == (10, 3)


# ---- obstacles


def upstream_line(x0, y0, x1, y1, reach):
    """Cells of Costmap2D::raytraceLine: Bresenham from the middle of the error, cut to `reach` cells of length."""
    dx, dy = x1 - x0, y1 - y0
    long, short = max(abs(dx), abs(dy)), min(abs(dx), abs(dy))
    length = math.hypot(dx, dy)
    count = int(long if length == 0.0 else min(1.0, reach / length) * long)
    sx, sy = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    error, x, y, cells = long // 2, x0, y0, []
    for _ in range(count):
        cells.append((x, y))
        error += short
        diagonal = error >= long
        error -= long if diagonal else 0
        along_x = abs(dx) >= abs(dy)
        x += sx if along_x or diagonal else 0
        y += sy if not along_x or diagonal else 0
    return [*cells, (x, y)]


@pytest.mark.parametrize("reach", [8, 25, 1000])
def test_rays_clear_upstreams_cells(reach):
    """costmap_2d.h, raytraceLine and bresenham2D; MarkCell sets each cell of the line, both ends included."""
    rng = np.random.default_rng(reach)
    for _ in range(100):
        start, end = rng.uniform(0.0, 6.0, 2), rng.uniform(0.0, 6.0, 2)
        cells = np.full((60, 60), LETHAL, np.uint8)
        changes = np.array([99, 99, 0, 0, 0])
        noted = np.empty(100, np.int32)
        kernels.clear_rays(cells, 0.1, 0.0, 0.0, *start, end[None], reach, noted, changes)
        kernels.settle(cells, noted, changes)
        line = upstream_line(*np.floor(start / 0.1).astype(int), *np.floor(end / 0.1).astype(int), reach)
        assert sorted((x, y) for y, x in np.argwhere(cells == FREE)) == sorted((int(x), int(y)) for x, y in line)
        xs, ys = zip(*line, strict=True)
        assert changes.tolist() == [min(xs), min(ys), max(xs) + 1, max(ys) + 1, 0]


def test_rays_are_cut_at_the_windows_edge():
    """obstacle_layer.cpp, raytraceFreespace: a ray that leaves the window ends in its last cell."""
    cells = np.full((60, 60), LETHAL, np.uint8)
    changes, noted = np.array([99, 99, 0, 0, 0]), np.empty(10, np.int32)  # too small on purpose
    kernels.clear_rays(cells, 0.1, 0.0, 0.0, 3.05, 3.05, np.array([[9.05, 3.05], [3.05, -4.0]]), 1000, noted, changes)
    assert changes[4] > len(noted)
    kernels.settle(cells, noted, changes)
    assert sorted(map(tuple, np.argwhere(cells == FREE).tolist())) == sorted(
        {(30, x) for x in range(30, 60)} | {(y, 30) for y in range(31)}
    )


@pytest.mark.parametrize(("length", "marked"), [(1.999, True), (2.001, False), (2.5, False)])
def test_hits_are_marked_within_the_obstacle_range(length, marked):
    """obstacle_layer.cpp, updateBounds: a point at obstacle_range or farther is skipped."""
    costmap = obstacle_map(source={"obstacle_range": 2.0})
    see(costmap, (0, length))
    assert (costmap.grid.at(0.05 + length, 0.05) == LETHAL) == marked


def test_cells_are_cleared_within_the_raytrace_range():
    """obstacle_layer.cpp, raytraceFreespace: raytrace_range in cells, rounded up."""
    costmap = obstacle_map(source={"obstacle_range": 3.0, "raytrace_range": 1.5})
    see(costmap, (0, 1.5), (2, 1.7))
    see(costmap, (0, 2.5), (2, 2.5), now=1.0)
    assert costmap.grid.at(1.55, 0.05) == FREE
    assert costmap.grid.at(1.74, 0.11) == LETHAL


@pytest.mark.parametrize(
    ("height", "marks", "clears"),
    [(0.1, True, True), (0.05, False, False), (1.5, False, False), (0.8, False, True), (0.6, True, True)],
)
def test_heights_of_points(height, marks, clears):
    """observation_buffer.cpp, bufferCloud: points outside the source's heights are dropped, for clearing too.

    obstacle_layer.cpp, updateBounds: those above the layer's max_obstacle_height are not marked.
    """
    source = {"min_obstacle_height": 0.1, "max_obstacle_height": 1.0, "obstacle_range": 3.0}
    costmap = obstacle_map(source=source, layer={"max_obstacle_height": 0.7})
    see(costmap, (0, 1.0))
    see(costmap, (0, 2.0), now=1.0, height=height)
    assert (costmap.grid.at(1.05, 0.05) == FREE) == clears
    assert (costmap.grid.at(2.05, 0.05) == LETHAL) == marks


@pytest.mark.parametrize(
    ("valid", "beam", "cleared"),
    [
        (False, np.inf, False),
        (True, np.inf, True),
        (True, -np.inf, False),
        (True, np.nan, False),
        (True, 10.0, False),
        (True, 0.05, False),
    ],
)
def test_beams_that_hit_nothing(valid, beam, cleared):
    """obstacle_layer.cpp, laserScanValidInfCallback: +inf becomes range_max - 0.0001; laser_geometry drops the rest.

    laser_geometry.cpp, projectLaser: range_min <= range < range_max.
    """
    costmap = obstacle_map(source={"inf_is_valid": valid})
    see(costmap, (0, 1.0))
    see(costmap, (0, beam), now=1.0)
    assert (costmap.grid.at(1.05, 0.05) == FREE) == cleared
    assert (costmap.cells == LETHAL).sum() == (0 if cleared else 1)


@pytest.mark.parametrize(("persistence", "left"), [(0.0, [2.0]), (1.0, [1.5, 2.0]), (5.0, [1.0, 1.5, 2.0])])
def test_observations_are_kept(persistence, left):
    """wiki, observation_persistence: how long to keep each reading, 0 only the most recent (purgeStaleObservations)."""
    costmap = obstacle_map(source={"observation_persistence": persistence, "obstacle_range": 3.0})
    for stamp, length in ((0.0, 1.0), (1.5, 1.5), (2.0, 2.0)):
        see(costmap, (0, length), now=stamp)
    assert np.flatnonzero(costmap.cells[30] == LETHAL).tolist() == [30 + round(v * 10) for v in left]


def test_unknown_space_is_tracked_where_asked():
    """obstacle_layer.cpp, onInitialize: track_unknown_space is the costmap's where the layer has none."""
    costmap = obstacle_map(track_unknown_space=True)
    assert set(np.unique(costmap.cells)) == {UNKNOWN}
    see(costmap, (0, 1.0))
    assert costmap.cells[30, 30:42].tolist() == [FREE] * 10 + [LETHAL, UNKNOWN]
    assert set(np.unique(obstacle_map(track_unknown_space=True, layer={"track_unknown_space": False}).cells)) == {
        UNKNOWN
    }


# ---- footprint


@pytest.mark.parametrize(
    "value",
    [
        SQUARE,
        str(SQUARE),
        "[[0.1,0.1],[0.1,-0.1],[-0.1,-0.1],[-0.1,0.1]]",
        [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]],
    ],
)
def test_footprints_are_padded(value):
    """footprint.cpp, makeFootprintFromParams (list or text) and padFootprint: sign0(x) * padding on each coordinate."""
    footprint = Footprint.of(value, robot_radius=9.0, padding=0.03)
    assert np.allclose(footprint.corners, [[0.13, 0.13], [0.13, -0.13], [-0.13, -0.13], [-0.13, 0.13]])
    assert footprint.inscribed_radius == pytest.approx(0.13)
    assert footprint.circumscribed_radius == pytest.approx(math.hypot(0.13, 0.13))


def test_a_radius_is_a_polygon_of_sixteen():
    """footprint.cpp, makeFootprintFromRadius: N = 16; padFootprint leaves a coordinate of 0 alone."""
    footprint = Footprint.of("[]", robot_radius=0.5, padding=0.01)
    assert len(footprint.corners) == 16
    assert footprint.corners[0].tolist() == pytest.approx([0.51, 0.0])


def test_the_robots_cells_are_freed_where_asked():
    """obstacle_layer.cpp, updateFootprint: footprint_clearing_enabled."""
    for enabled in (True, False):
        costmap = obstacle_map(layer={"footprint_clearing_enabled": enabled})
        see(costmap, (0, 1.0))
        costmap.obstacle_layers[0].buffers["scan"].clear()
        costmap.update(1.0, Pose2D(1.05, 0.05))
        assert (costmap.grid.at(1.05, 0.05) == FREE) == enabled


# ---- parameters of all eras


def test_pre_hydro_parameters():
    """costmap_2d_ros.cpp, loadOldParameters: static only where static_map; sources, ranges and inflation are moved."""
    tree = {
        "static_map": True,
        "map_topic": "/m",
        "lethal_cost_threshold": 60,
        "track_unknown_space": False,
        "max_obstacle_height": 0.4,
        "obstacle_range": 6.0,
        "raytrace_range": 8.5,
        "observation_sources": "laser",
        "laser": {"data_type": "LaserScan", "topic": "scan", "raytrace_range": 7.0},
        "inflation_radius": 2.5,
        "cost_scaling_factor": 4.0,
        "map_type": "voxel",
        "z_voxels": 4,
    }
    static, obstacles, inflation = read_costmap(tree).layers
    assert (static.params.map_topic, static.params.lethal_cost_threshold) == ("/m", 60)
    assert static.params.track_unknown_space is False
    assert (obstacles.type, obstacles.params.max_obstacle_height, obstacles.params.z_voxels) == ("VoxelLayer", 0.4, 4)
    assert (obstacles.sources["laser"].obstacle_range, obstacles.sources["laser"].raytrace_range) == (6.0, 7.0)
    assert (inflation.params.inflation_radius, inflation.params.cost_scaling_factor) == (2.5, 4.0)
    assert [layer.name for layer in read_costmap({**tree, "static_map": False}).layers] == [
        "obstacle_layer",
        "inflation_layer",
    ]


def test_layers_take_parameters_of_the_costmap():
    """costmap_2d_ros.cpp, copyParentParameters: with plugins, the costmap's own values go over the layers'."""
    plugins = [{"name": "a", "type": "costmap_2d::ObstacleLayer"}, {"name": "b", "type": "costmap_2d::InflationLayer"}]
    tree = {"plugins": plugins, "inflation_radius": 1.5, "b": {"inflation_radius": 0.2, "cost_scaling_factor": 2.0}}
    params = read_costmap({**tree, "max_obstacle_height": 0.3}).layers
    assert (params[1].params.inflation_radius, params[1].params.cost_scaling_factor) == (1.5, 2.0)
    assert params[0].params.max_obstacle_height == 0.3


@pytest.mark.parametrize(
    ("changes", "height", "marked"),
    [
        ({}, 0.1, True),
        ({"z_voxels": 2}, 0.39, True),
        ({"z_voxels": 2}, 0.41, False),
        ({"mark_threshold": 1}, 0.1, False),
    ],
)
def test_a_voxel_layer_over_a_planar_scan(changes, height, marked):
    """voxel_layer.cpp, updateBounds: what is above the column is no voxel; more than mark_threshold mark a cell."""
    plugins = [{"name": "obstacles", "type": "costmap_2d::VoxelLayer"}]
    costmap = obstacle_map(plugins=plugins, layer=changes)
    see(costmap, (0, 1.0), height=height)
    assert (costmap.grid.at(1.05, 0.05) == LETHAL) == marked
