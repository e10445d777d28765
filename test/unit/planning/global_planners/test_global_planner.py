"""What global_planner/GlobalPlanner adds: its prices, paths over the grid, the outline, headings."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbot_patrol.errors import GoalOccupied, NoPath, ParamError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.global_planners.global_planner import (
    GlobalPlannerParams,
    PotentialFieldPlanner,
    crossing_costs,
)
from rosbot_patrol.planning.global_planners.orientation import OrientationMode, with_orientations
from rosbot_patrol.planning.registry import GLOBAL_PLANNERS, TUNABLE, make_global_planner

START, GOAL = Pose2D(0.55, 0.55, 0.4), Pose2D(2.55, 1.55, -2.0)


def hall():
    return Grid(GridInfo(resolution=0.1, width=30, height=20), np.zeros((20, 30), np.uint8))


def test_upstreams_defaults():
    p = GlobalPlannerParams()
    assert (p.lethal_cost, p.neutral_cost, p.cost_factor) == (253, 50, 3.0)
    assert (p.allow_unknown, p.use_grid_path, p.orientation_mode, p.orientation_window_size) == (True, False, 1, 1)


def test_prices_follow_upstreams_formula():
    table = crossing_costs(GlobalPlannerParams())
    assert table[0] == 50.0
    assert table[20] == 110.0
    assert table[67] == 251.0
    assert table[68] == table[251] == table[255] == 252.0
    assert np.isinf(table[[252, 253, 254]]).all()
    table = crossing_costs(GlobalPlannerParams(neutral_cost=66, cost_factor=0.55, lethal_cost=200, allow_unknown=False))
    assert table[100] == pytest.approx(121.0)
    assert table[198] == pytest.approx(174.9)
    assert np.isinf(table[199:]).all()


def test_a_grid_path_steps_to_neighbours_and_cuts_no_corner():
    grid = hall()
    grid.cells[0:12, 15] = 254
    before = grid.cells.copy()
    path = PotentialFieldPlanner(GlobalPlannerParams(use_grid_path=True)).plan(grid, START, GOAL)
    cells = np.array([grid.info.cell_of(x, y) for x, y in path[:, :2]])
    steps = np.abs(np.diff(cells, axis=0))
    assert steps.max() == 1
    assert (steps.sum(axis=1) > 0).all()
    for (ax, ay), (bx, by) in pairwise(cells):
        assert before[ay, bx] == before[by, ax] == 0
    assert path[:-1, :2] == pytest.approx(np.array([grid.info.centre_of(*c) for c in cells[:-1]]))
    assert path[-1].tolist() == pytest.approx(list(GOAL))


def test_the_outline_closes_the_border_unless_it_is_off():
    edge = Pose2D(2.55, 0.05)
    with pytest.raises(GoalOccupied):
        PotentialFieldPlanner().plan(hall(), START, edge)
    path = PotentialFieldPlanner(GlobalPlannerParams(outline_map=False)).plan(hall(), START, edge)
    assert path[-1, :2].tolist() == [2.55, 0.05]
    grid = hall()
    grid.cells[1:, 15] = 254
    with pytest.raises(NoPath):
        PotentialFieldPlanner().plan(Grid(grid.info, grid.cells.copy()), START, GOAL)
    assert len(PotentialFieldPlanner(GlobalPlannerParams(outline_map=False)).plan(grid, START, GOAL)) > 10


def test_parameters_come_by_name_and_are_checked():
    planner = make_global_planner("global_planner/GlobalPlanner", {"GlobalPlanner": {"orientation_mode": 1}})
    path = planner.plan(hall(), START, GOAL)
    assert path[0, 2] == pytest.approx(math.atan2(1.0, 2.0), abs=0.02)
    clamped = make_global_planner("GlobalPlanner", {"GlobalPlanner": {"orientation_mode": 7, "lethal_cost": 300}})
    assert (clamped.params.orientation_mode, clamped.params.lethal_cost) == (6, 255)
    with pytest.raises(ParamError, match="lethal_cost"):
        make_global_planner("GlobalPlanner", {"GlobalPlanner": {"lethal_cost": "high"}})


def test_parameters_change_in_use():
    planner = make_global_planner("GlobalPlanner", {"GlobalPlanner": {"cost_factor": 1.0}})
    changed = planner.reconfigure({"neutral_cost": 80, "outline_map": False, "orientation_mode": 4})
    assert (changed.neutral_cost, changed.cost_factor) == (80, 1.0)
    assert planner.prices[[0, 10]].tolist() == [80.0, 90.0]
    path = planner.plan(hall(), START, Pose2D(2.55, 0.05))
    assert abs(path[0, 2]) > math.pi / 2
    with pytest.raises(ParamError, match="~GlobalPlanner/cost_factor"):
        planner.reconfigure({"cost_factor": "dear"}, name="~GlobalPlanner/")
    with pytest.raises(ParamError, match="use_grid_path"):
        planner.reconfigure({"use_grid_path": True})
    assert planner.params == changed


def test_navfns_parameters_change_in_use():
    grid = hall()
    grid.cells[:, 15] = 255
    planner = make_global_planner("navfn/NavfnROS", {})
    assert len(planner.plan(Grid(grid.info, grid.cells.copy()), START, GOAL)) > 10
    planner.reconfigure({"allow_unknown": False, "default_tolerance": 1.2})
    assert planner.plan(grid, START, GOAL)[-1, 0] == pytest.approx(1.45)


@pytest.mark.parametrize("plugin", GLOBAL_PLANNERS)
def test_what_can_be_tuned_is_declared(plugin):
    names = {row.name for row in TUNABLE[plugin]}
    assert names == set(make_global_planner(plugin, {}).tunable)
    assert all(row.type in ("bool", "int", "float") for row in TUNABLE[plugin])


# ---- headings

BEND = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [2.0, 3.0], [2.0, 4.0]])


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        (0, [0, 0, 0, 0, 0, 0, -1.0]),
        (1, [0.0, 0.0, math.pi / 4, math.pi / 2, math.pi / 2, math.pi / 2, -1.0]),
        (4, [math.pi, math.pi, -3 * math.pi / 4, -math.pi / 2, -math.pi / 2, -math.pi / 2, -1.0]),
        (5, [-math.pi / 2, -math.pi / 2, -math.pi / 4, 0.0, 0.0, 0.0, -1.0]),
        (6, [math.pi / 2, math.pi / 2, 3 * math.pi / 4, math.pi, math.pi, math.pi, -1.0]),
    ],
)
def test_headings_by_mode(mode, expected):
    poses = with_orientations(BEND, 0.5, -1.0, OrientationMode(mode), 1)
    assert poses[:, :2].tolist() == BEND.tolist()
    off = np.angle(np.exp(1j * (poses[:, 2] - np.array(expected))))
    assert off == pytest.approx(0.0, abs=1e-12)
    assert np.abs(poses[:, 2]).max() <= math.pi


def test_interpolated_headings_turn_evenly_the_short_way():
    poses = with_orientations(BEND, 3.0, -3.0, OrientationMode.INTERPOLATE, 1)
    assert poses[0, 2] == pytest.approx(3.0)
    assert poses[-1, 2] == pytest.approx(-3.0)
    steps = np.angle(np.exp(1j * np.diff(poses[:, 2])))
    assert steps == pytest.approx((math.tau - 6.0) / 6.0)


def test_forward_then_interpolated_turns_on_the_last_straight_run():
    poses = with_orientations(BEND, 0.5, 0.0, OrientationMode.FORWARD_THEN_INTERPOLATE, 1)
    assert poses[:, 2] == pytest.approx([0.5, 0.0, math.pi / 4, math.pi / 2, math.pi / 3, math.pi / 6, 0.0], abs=1e-12)


def test_a_wider_window_sees_the_bend_before():
    narrow = with_orientations(BEND, 0.0, 0.0, OrientationMode.FORWARD, 1)
    wide = with_orientations(BEND, 0.0, 0.0, OrientationMode.FORWARD, 2)
    assert narrow[1, 2] == 0.0
    assert wide[1, 2] == pytest.approx(math.atan2(1.0, 2.0))


@pytest.mark.parametrize("mode", list(OrientationMode))
def test_two_points_are_enough(mode):
    poses = with_orientations(np.array([[0.0, 0.0], [1.0, 1.0]]), 0.1, 0.2, mode, 3)
    assert np.isfinite(poses).all()
    assert poses[-1, 2] == pytest.approx(0.2)
