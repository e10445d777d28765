"""Every global planner over small maps: the right path, or the right error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL, UNKNOWN
from rosbot_patrol.errors import GoalOccupied, NoPath, OutOfBounds, StartOccupied
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.registry import GLOBAL_PLANNERS, make_global_planner, short_name

COSTS = {"#": LETHAL, "+": INSCRIBED, "?": UNKNOWN, "o": 200, ".": 0, "S": 0, "G": 0}

MAZE = """
####################
#S.#...............#
#..#.###########...#
#..#.#.........#...#
#..#.#.#####...#...#
#..#.#.#G..#...#...#
#..#.#.###.#...#...#
#..#.#.....#...#...#
#..#.#######...#...#
#..#.............#.#
#..############..#.#
#................#.#
####################
"""

GAP = """
###############
#S.....#......#
#......#......#
#.............#
#......#......#
#......#.....G#
###############
"""

CLOSED = GAP.replace("#.............#", "#......#......#")

POCKET = """
###############
#S.....?......#
#......?......#
#......?......#
#......?.....G#
###############
"""

OPEN = "\n".join(["." * 60] * 40).replace(".", "S", 1)


def picture(text, resolution=0.1):
    rows = text.split()[::-1]
    cells = np.array([[COSTS[c] for c in row] for row in rows], np.uint8)
    info = GridInfo(resolution=resolution, width=cells.shape[1], height=cells.shape[0], origin_x=-3.0, origin_y=2.0)
    found = {c: info.centre_of(row.index(c), iy) for iy, row in enumerate(rows) for c in "SG" if c in row}
    return Grid(info, cells), *(Pose2D(*found[c], 0.7) if c in found else None for c in "SG")


@pytest.fixture(params=GLOBAL_PLANNERS)
def make(request):
    def build(**params):
        return make_global_planner(request.param, {short_name(request.param): params})

    return build


def check(path, grid, start, goal):
    assert path.shape[1] == 3
    assert math.dist(path[0, :2], (start.x, start.y)) <= grid.info.resolution
    assert path[-1].tolist() == pytest.approx(list(goal))
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert steps.max() <= 2.0 * grid.info.resolution
    for a, b in zip(path[:-1, :2], path[1:, :2], strict=True):
        for t in np.linspace(0.0, 1.0, 5):
            x, y = a + t * (b - a)
            assert grid.at(x, y) < INSCRIBED or grid.at(x, y) == UNKNOWN
    return float(steps.sum())


@pytest.mark.parametrize("text", [MAZE, GAP])
def test_finds_the_way(make, text):
    grid, start, goal = picture(text)
    check(make().plan(Grid(grid.info, grid.cells.copy()), start, goal), grid, start, goal)


def test_a_closed_wall_has_no_way(make):
    grid, start, goal = picture(CLOSED)
    with pytest.raises(NoPath):
        make().plan(grid, start, goal)


def test_unknown_space_is_crossed_only_if_allowed(make):
    grid, start, goal = picture(POCKET)
    check(make(allow_unknown=True).plan(Grid(grid.info, grid.cells.copy()), start, goal), grid, start, goal)
    with pytest.raises(NoPath):
        make(allow_unknown=False).plan(grid, start, goal)


@pytest.mark.parametrize("angle", np.linspace(0.0, math.pi / 2, 7))
def test_a_free_field_is_crossed_straight(make, angle):
    grid, start, _ = picture(OPEN)
    start = Pose2D(-2.5, 2.5)
    goal = Pose2D(-2.5 + 2.8 * math.cos(angle), 2.5 + 2.8 * math.sin(angle), 0.0)
    length = check(make().plan(grid, start, goal), grid, start, goal)
    assert length <= 1.02 * 2.8


def test_costs_are_avoided(make):
    text = "\n".join(["." * 30] * 8 + ["S" + "." * 5 + "o" * 18 + "." * 5 + "G"] + ["." * 30] * 8)
    grid, start, goal = picture(text)
    path = make().plan(Grid(grid.info, grid.cells.copy()), start, goal)
    assert max(grid.at(x, y) for x, y in path[:, :2]) == 0


@pytest.mark.parametrize(("x", "y"), [(100.0, 2.5), (-2.95, -50.0), (math.nan, 2.5), (math.inf, 2.5)])
def test_off_the_map(make, x, y):
    grid, start, _ = picture(OPEN)
    with pytest.raises(OutOfBounds, match="goal"):
        make().plan(grid, start, Pose2D(x, y))
    with pytest.raises(OutOfBounds, match="start"):
        make().plan(grid, Pose2D(x, y), start)


@pytest.mark.parametrize("cost", [LETHAL, INSCRIBED])
def test_an_occupied_goal(make, cost):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(goal.x, goal.y)
    grid.cells[iy, ix] = cost
    with pytest.raises(GoalOccupied):
        make().plan(grid, start, goal)


def test_an_occupied_goal_is_replaced_within_the_tolerance(make):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(goal.x, goal.y)
    grid.cells[iy, ix] = LETHAL
    path = make(default_tolerance=0.25).plan(Grid(grid.info, grid.cells.copy()), start, goal)
    assert 0.05 < math.dist(path[-1, :2], (goal.x, goal.y)) <= 0.25
    assert path[-1, 2] == goal.yaw


def test_an_occupied_start(make):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(start.x, start.y)
    grid.cells[iy, ix] = LETHAL
    with pytest.raises(StartOccupied):
        make().plan(grid, start, goal)


def test_a_start_too_near_to_a_wall_leads_out(make):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(start.x, start.y)
    grid.cells[iy - 1 : iy + 2, ix - 0 : ix + 3][grid.cells[iy - 1 : iy + 2, ix : ix + 3] == 0] = INSCRIBED
    path = make().plan(Grid(grid.info, grid.cells.copy()), start, goal)
    assert path[-1, :2].tolist() == pytest.approx([goal.x, goal.y])


def test_start_and_goal_in_one_cell(make):
    grid, start, _ = picture(GAP)
    path = make().plan(grid, start, Pose2D(start.x + 0.02, start.y, 1.0))
    assert len(path) >= 2
    assert path[-1].tolist() == pytest.approx([start.x + 0.02, start.y, 1.0])


@pytest.mark.parametrize("seed", range(20))
def test_random_clutter_never_crosses_an_obstacle(make, seed):
    rng = np.random.default_rng(seed)
    grid, start, _ = picture(OPEN)
    grid.cells[rng.random(grid.cells.shape) < 0.25] = LETHAL
    goal = Pose2D(*grid.info.centre_of(58, 1), 0.0)
    start = Pose2D(*grid.info.centre_of(1, 38))
    grid.cells[38, 1] = grid.cells[1, 58] = 0
    try:
        path = make().plan(Grid(grid.info, grid.cells.copy()), start, goal)
    except NoPath:
        return
    check(path, grid, start, goal)
