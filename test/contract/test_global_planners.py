"""Every global planner over small maps: the right path, or the right error.

Maps are pictures in text: # lethal, + inscribed, ? unknown, o dear, S start, G goal, anything else free. `times` cuts
each cell into so many, so that a map is solved as a whole or block by block (`global_planner_search`).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from rosbot_patrol.costmap.bounds import Bounds
from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL, UNKNOWN
from rosbot_patrol.costmap.footprint import Footprint, circle_footprint
from rosbot_patrol.costmap.layers.inflation import InflationLayer
from rosbot_patrol.costmap.params import InflationParams
from rosbot_patrol.errors import GoalOccupied, NoPath, OutOfBounds, StartOccupied
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.registry import GLOBAL_PLANNERS, make_global_planner, short_name

COSTS = {"#": LETHAL, "+": INSCRIBED, "?": UNKNOWN, "o": 40}

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
TOO_NARROW = GAP.replace("#.............#", "#......+......#")

POCKET = """
###############
#S.....?......#
#......?......#
#......?......#
#......?.....G#
###############
"""

AROUND = """
##################
#................#
#.......??.......#
#S.....????.....G#
#.......??.......#
#................#
##################
"""

SHUT_IN = """
##################
#......#.........#
#.S....#......####
#......#......#G.#
########......####
#................#
##################
"""

HALL = "\n".join(["#" * 60, *["#" + "." * 58 + "#"] * 38, "#" * 60])


def picture(text, resolution=0.1, times=1):
    rows = text.split()[::-1]
    cells = np.array([[COSTS.get(c, 0) for c in row] for row in rows], np.uint8)
    found = {c: (row.index(c), iy) for iy, row in enumerate(rows) for c in "SG" if c in row}
    info = GridInfo(resolution=resolution, width=cells.shape[1], height=cells.shape[0], origin_x=-3.0, origin_y=2.0)
    ends = [Pose2D(*info.centre_of(*found[c]), 0.7) if c in found else None for c in "SG"]
    if times > 1:
        cells = np.kron(cells, np.ones((times, times), np.uint8))
        height, width = cells.shape
        info = GridInfo(resolution=resolution / times, width=width, height=height, origin_x=-3.0, origin_y=2.0)
    return Grid(info, cells), *ends


def copy(grid):
    return Grid(grid.info, grid.cells.copy())


@pytest.fixture(params=GLOBAL_PLANNERS)
def make(request):
    def build(**params):
        return make_global_planner(request.param, {short_name(request.param): params})

    return build


def check(path, grid, start, goal, *, unknown=True):
    """Length of a path that is sound: from the start to the goal, connected, and through no obstacle."""
    assert path.shape[1] == 3
    assert np.isfinite(path).all()
    assert math.dist(path[0, :2], (start.x, start.y)) <= grid.info.resolution
    assert path[-1].tolist() == pytest.approx(list(goal))
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert steps.max() <= 2.0 * grid.info.resolution
    for a, b in pairwise(path[:, :2]):
        for t in np.linspace(0.0, 1.0, 5):
            cost = grid.at(*(a + t * (b - a)))
            assert cost < INSCRIBED or (unknown and cost == UNKNOWN)
    return float(steps.sum())


def turns(path, span):
    """Change of direction between stretches of `span` poses, rad."""
    xy = path[:, :2]
    way = xy[span:] - xy[:-span]
    yaw = np.arctan2(way[:, 1], way[:, 0])
    return np.abs(np.angle(np.exp(1j * (yaw[span:] - yaw[:-span]))))


# ---- there is a way


@pytest.mark.parametrize("times", [1, 2, 25])
@pytest.mark.parametrize("text", [MAZE, GAP])
def test_finds_the_way(make, text, times):
    grid, start, goal = picture(text, times=times)
    check(make().plan(copy(grid), start, goal), grid, start, goal)


@pytest.mark.parametrize("column", range(120, 136))
@pytest.mark.parametrize("row", [140, 147])
def test_a_gap_of_one_cell_in_a_large_map(make, column, row):
    info = GridInfo(resolution=0.05, width=320, height=290)
    cells = np.zeros(info.shape, np.uint8)
    cells[:, column] = LETHAL
    cells[row, column] = 0
    grid, start, goal = Grid(info, cells), Pose2D(1.0, 1.0), Pose2D(15.0, 13.0, -1.0)
    check(make().plan(copy(grid), start, goal), grid, start, goal)


@pytest.mark.parametrize("resolution", [0.01, 0.02, 0.03, 0.05, 0.1])
@pytest.mark.parametrize(("width", "passes"), [(0.2, False), (0.55, True), (0.9, True)])
def test_a_door(make, resolution, width, passes):
    """A robot of 0.15 m passes a door that leaves it a cell, at any resolution."""
    info = GridInfo(resolution=resolution, width=round(4.0 / resolution), height=round(3.0 / resolution))
    x, y = ((np.arange(n) + 0.5) * resolution for n in (info.width, info.height))
    is_wall = (np.abs(x[None, :] - 2.0) < 0.1) & (np.abs(y[:, None] - 1.5) > width / 2.0)
    grid = Grid(info, np.where(is_wall, LETHAL, 0).astype(np.uint8))
    corners = circle_footprint(0.15, 64)
    layer = InflationLayer(InflationParams(inflation_radius=0.5))
    layer.match(info, Footprint(corners, corners))
    layer.update_costs(grid.cells, Bounds(0, 0, info.width, info.height))
    start, goal = Pose2D(0.6, 0.6), Pose2D(3.4, 0.6)
    if passes:
        path = make().plan(copy(grid), start, goal)
        check(path, grid, start, goal)
        at_door = path[np.argmin(np.abs(path[:, 0] - 2.0))]
        assert at_door[1] == pytest.approx(1.5, abs=width / 2.0 - 0.1)
    else:
        with pytest.raises(NoPath, match="too narrow") as caught:
            make().plan(copy(grid), start, goal)
        place = [float(word) for word in str(caught.value).rsplit("(", 1)[1].rstrip(")").split(", ")]
        assert place == pytest.approx([2.0, 1.5], abs=0.3)


def random_map(seed, size):
    rng = np.random.default_rng(seed)
    cells = np.zeros((size, size), np.uint8)
    for _ in range(40):
        x, y = rng.integers(0, size, 2)
        w, h = rng.integers(1, size // 3, 2)
        cells[y : y + (1 if seed % 2 else h // 4), x : x + w] = LETHAL
        cells[y : y + h, x : x + (1 if seed % 3 else w // 6)] = LETHAL
    cells[rng.random(cells.shape) < 0.02] = LETHAL
    return cells


def is_connected(cells, start, goal):
    """Whether two cells are joined over edges of open cells, by growing the start's region."""
    is_open = cells < INSCRIBED
    reached = np.zeros_like(is_open)
    reached[start[::-1]] = True
    while True:
        grown = reached.copy()
        grown[1:] |= reached[:-1]
        grown[:-1] |= reached[1:]
        grown[:, 1:] |= reached[:, :-1]
        grown[:, :-1] |= reached[:, 1:]
        grown &= is_open
        if (grown == reached).all():
            return bool(reached[goal[::-1]])
        reached = grown


@pytest.mark.parametrize("size", [60, 300])
@pytest.mark.parametrize("seed", range(6))
def test_a_way_is_found_where_there_is_one(make, seed, size):
    cells = random_map(seed, size)
    rng = np.random.default_rng(seed)
    info = GridInfo(resolution=0.05, width=size, height=size)
    free = np.argwhere(cells[1:-1, 1:-1] == 0)[:, ::-1] + 1
    for a, b in free[rng.integers(0, len(free), (4, 2))].tolist():
        start, goal = (Pose2D(*info.centre_of(*cell)) for cell in (a, b))
        outlined = cells.copy()
        outlined[[0, -1]] = outlined[:, [0, -1]] = LETHAL
        if is_connected(outlined, tuple(a), tuple(b)):
            check(make().plan(Grid(info, outlined.copy()), start, goal), Grid(info, outlined), start, goal)
        else:
            with pytest.raises(NoPath, match="shut in"):
                make().plan(Grid(info, outlined.copy()), start, goal)


@pytest.mark.parametrize("times", [1, 12])
def test_the_same_twice(make, times):
    grid, start, goal = picture(MAZE, times=times)
    planner = make()
    first = planner.plan(copy(grid), start, goal)
    planner.plan(copy(picture(GAP)[0]), *picture(GAP)[1:])
    assert (planner.plan(copy(grid), start, goal) == first).all()


# ---- it is the best way


@pytest.mark.parametrize("times", [1, 6])
@pytest.mark.parametrize("angle", np.linspace(0.0, math.pi / 2, 7))
def test_a_free_hall_is_crossed_straight(make, angle, times):
    grid, _, _ = picture(HALL, times=times)
    start = Pose2D(-2.55, 2.55)
    goal = Pose2D(-2.55 + 2.8 * math.cos(angle), 2.55 + 2.8 * math.sin(angle), 0.0)
    path = make().plan(copy(grid), start, goal)
    assert check(path, grid, start, goal) <= 1.003 * 2.8
    assert turns(path, 8).max() < 0.05


@pytest.mark.parametrize("times", [1, 3, 8])
def test_round_the_end_of_a_wall(make, times):
    """The shortest way is a string pulled taut about the wall's end."""
    text = "\n".join(
        ["#" * 60] + ["#" + "." * 58 + "#"] * 14 + ["#" + "." * 28 + "##" + "." * 28 + "#"] * 24 + ["#" * 60]
    )
    grid, _, _ = picture(text, times=times)
    start, goal = Pose2D(-1.05, 2.55, 0.0), Pose2D(1.05, 3.35, 0.0)
    left, right = (-0.1, 4.5), (0.1, 4.5)
    taut = math.dist((start.x, start.y), left) + 0.2 + math.dist(right, (goal.x, goal.y))
    path = make().plan(copy(grid), start, goal)
    length = check(path, grid, start, goal)
    # the corner is passed through the middle of the cells beside it
    assert taut * 0.999 <= length <= 1.01 * taut + 1.2 * grid.info.resolution
    assert turns(path, 2).max() < 1.3


@pytest.mark.parametrize("times", [2, 6])
def test_where_it_is_dearer_the_way_bends_as_light_does(make, times):
    """Between two halves of different price the cheapest way obeys Snell's law."""
    text = "\n".join(["#" * 60] + ["#" + "." * 58 + "#"] * 19 + ["#" + "o" * 58 + "#"] * 19 + ["#" * 60])
    grid, _, _ = picture(text, times=times)
    planner = make()
    free, dear = float(planner.prices[0]), float(planner.prices[COSTS["o"]])
    start, goal = Pose2D(-2.0, 5.5, 0.0), Pose2D(1.5, 2.5, 0.0)
    border = 2.0 + 2.0

    def price(x):
        return free * math.dist((start.x, start.y), (x, border)) + dear * math.dist((x, border), (goal.x, goal.y))

    xs = np.linspace(-2.0, 1.5, 3501)
    best = min(price(x) for x in xs)
    path = planner.plan(copy(grid), start, goal)
    check(path, grid, start, goal)
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    middles = (path[1:, :2] + path[:-1, :2]) / 2.0
    ours = float((steps * np.where(middles[:, 1] > border, free, dear)).sum())
    assert ours <= 1.01 * best


def test_costs_are_avoided(make):
    rows = ["#" * 30] + ["#" + "." * 28 + "#"] * 8 + ["#S" + "." * 4 + "o" * 18 + "." * 4 + "G#"]
    grid, start, goal = picture("\n".join([*rows, *rows[8::-1]]))
    grid.cells[grid.cells == COSTS["o"]] = 200
    path = make().plan(copy(grid), start, goal)
    assert max(grid.at(x, y) for x, y in path[:, :2]) == 0


@pytest.mark.parametrize("times", [2, 4, 10])
def test_the_way_is_smooth(make, times):
    """It turns by less than 55 degrees even at the edge of what can be crossed, and not to and fro."""
    text = """
    ####################
    #......#...........#
    #......#...........#
    #.S....#......#....#
    #......#......#....#
    #......#......#....#
    #.............#....#
    #.............#..G.#
    #.............#....#
    ####################
    """
    grid, start, goal = picture(text, resolution=0.2, times=times)
    corners = circle_footprint(0.15)
    layer = InflationLayer(InflationParams(inflation_radius=0.5, cost_scaling_factor=6.0))
    layer.match(grid.info, Footprint(corners, corners))
    layer.update_costs(grid.cells, Bounds(0, 0, grid.info.width, grid.info.height))
    path = make().plan(copy(grid), start, goal)
    check(path, grid, start, goal)
    assert turns(path, 1).max() < 0.95
    assert turns(path, 1).sum() < 9.0  # three bends


# ---- there is no way


@pytest.mark.parametrize("times", [1, 25])
def test_a_closed_wall_has_no_way(make, times):
    grid, start, goal = picture(CLOSED, times=times)
    with pytest.raises(NoPath, match=r"shut in \(0.\d+ m2 .* an obstacle at \(-2.\d\d, 2.\d\d\)"):
        make().plan(grid, start, goal)


@pytest.mark.parametrize("times", [1, 25])
def test_a_gap_that_is_too_narrow_is_named(make, times):
    grid, start, goal = picture(TOO_NARROW, times=times)
    with pytest.raises(NoPath, match=r"a gap too narrow for the robot at \(-2.\d\d, 2.3\d\)"):
        make().plan(grid, start, goal)


@pytest.mark.parametrize(("swap", "end", "area"), [(False, "goal", "0.02"), (True, "start", "0.02")])
def test_the_smaller_end_is_the_one_shut_in(make, swap, end, area):
    grid, start, goal = picture(SHUT_IN.replace("########......####", "#......#......####"))
    ends = (goal, start) if swap else (start, goal)
    with pytest.raises(NoPath, match=rf"the {end} is shut in \({area} m2 .* an obstacle"):
        make().plan(grid, *ends)


@pytest.mark.parametrize("times", [1, 25])
def test_unknown_space_is_crossed_only_if_allowed(make, times):
    grid, start, goal = picture(POCKET, times=times)
    check(make(allow_unknown=True).plan(copy(grid), start, goal), grid, start, goal)
    with pytest.raises(NoPath, match=r"unknown space \(allow_unknown is false\) at \(-2.\d\d"):
        make(allow_unknown=False).plan(grid, start, goal)


@pytest.mark.parametrize("allow_unknown", [True, False])
def test_unknown_pockets_are_gone_round(make, allow_unknown):
    grid, start, goal = picture(AROUND, times=3)
    path = make(allow_unknown=allow_unknown).plan(copy(grid), start, goal)
    check(path, grid, start, goal, unknown=False)


@pytest.mark.parametrize(
    ("cost", "reason"), [(LETHAL, "in an obstacle"), (INSCRIBED, "too near to an obstacle"), (UNKNOWN, "unknown space")]
)
def test_an_occupied_goal(make, cost, reason):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(goal.x, goal.y)
    grid.cells[iy, ix] = cost
    with pytest.raises(GoalOccupied, match=reason):
        make(allow_unknown=False).plan(grid, start, goal)


def test_an_occupied_start(make):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(start.x, start.y)
    grid.cells[iy, ix] = LETHAL
    with pytest.raises(StartOccupied, match="in an obstacle"):
        make().plan(grid, start, goal)


@pytest.mark.parametrize(("x", "y"), [(100.0, 2.55), (-2.95, -50.0), (math.nan, 2.55), (math.inf, 2.55), (-2.0, 6.01)])
def test_off_the_map(make, x, y):
    grid, _, _ = picture(HALL)
    start = Pose2D(-2.55, 2.55)
    with pytest.raises(OutOfBounds, match=r"the goal .* is off the global costmap"):
        make().plan(grid, start, Pose2D(x, y))
    with pytest.raises(OutOfBounds, match=r"the start .* is off the global costmap"):
        make(default_tolerance=5.0).plan(grid, Pose2D(x, y), start)


# ---- the ends


@pytest.mark.parametrize("cost", [LETHAL, INSCRIBED])
def test_an_occupied_goal_is_replaced_within_the_tolerance(make, cost):
    grid, start, goal = picture(GAP)
    ix, iy = grid.info.cell_of(goal.x, goal.y)
    grid.cells[iy, ix] = cost
    path = make(default_tolerance=0.25).plan(copy(grid), start, goal)
    assert math.dist(path[-1, :2], (goal.x, goal.y)) == pytest.approx(0.1)
    assert path[-1, 2] == goal.yaw
    asked = make().plan(copy(grid), start, goal, tolerance=0.25)
    assert (asked == path).all()


@pytest.mark.parametrize("times", [1, 20])
def test_the_nearest_point_on_this_side_of_a_wall(make, times):
    grid, start, goal = picture(CLOSED, times=times)
    path = make(default_tolerance=0.8).plan(copy(grid), start, goal)
    edge = -3.0 + 0.7  # of the wall
    assert path[-1, 0] == pytest.approx(edge - grid.info.resolution / 2.0)
    check(path, grid, start, Pose2D(*path[-1, :2], goal.yaw))
    with pytest.raises(NoPath):
        make(default_tolerance=0.5).plan(copy(grid), start, goal)


def test_a_goal_beyond_a_rolling_window(make):
    """Upstream's navfn goes as near as the tolerance allows."""
    grid, _, _ = picture(HALL)
    grid.cells[:] = 0
    start, goal = Pose2D(-2.55, 2.55), Pose2D(3.2, 4.05, 0.3)
    planner = make(default_tolerance=0.5)
    path = planner.plan(copy(grid), start, goal)
    assert path[-1].tolist() == pytest.approx([2.95, 4.05, 0.3], abs=0.11)
    check(path, grid, start, Pose2D(*path[-1]))
    with pytest.raises(OutOfBounds, match="goal"):
        planner.plan(copy(grid), start, Pose2D(3.6, 4.05))
    with pytest.raises(OutOfBounds, match="goal"):
        planner.plan(copy(grid), start, goal, tolerance=0.0)


def test_the_wider_tolerance_does_not_move_a_goal_that_can_be_reached(make):
    grid, start, goal = picture(GAP)
    assert make(default_tolerance=1.0).plan(copy(grid), start, goal)[-1].tolist() == pytest.approx(list(goal))


@pytest.mark.parametrize("times", [1, 10])
def test_a_start_too_near_to_a_wall_leads_out(make, times):
    grid, start, goal = picture(GAP, times=times)
    ix, iy = grid.info.cell_of(start.x, start.y)
    near = grid.cells[iy - 2 * times : iy + 2 * times, ix : ix + 2 * times]
    near[near == 0] = INSCRIBED
    path = make().plan(copy(grid), start, goal)
    assert path[-1, :2].tolist() == pytest.approx([goal.x, goal.y])
    assert all(grid.at(x, y) != LETHAL for x, y in path[:, :2])


@pytest.mark.parametrize("shift", [0.0, 0.02, 0.1])
def test_start_and_goal_together(make, shift):
    grid, start, _ = picture(GAP)
    path = make().plan(grid, start, Pose2D(start.x + shift, start.y, 1.0))
    assert len(path) >= 2
    assert path[0, :2].tolist() == pytest.approx([start.x, start.y])
    assert path[-1].tolist() == pytest.approx([start.x + shift, start.y, 1.0])


@pytest.mark.parametrize("offset", [0.0, 0.05, 0.049999999, 0.0999999])
def test_ends_anywhere_in_their_cells(make, offset):
    grid, start, goal = picture(GAP)
    start, goal = Pose2D(-2.9 + offset, 2.5 + offset), Pose2D(-1.7 + offset, 2.1 + offset, 0.2)
    check(make().plan(copy(grid), start, goal), grid, start, goal)


def reached(free, start):
    """Cells that one comes to from a cell (iy, ix) by steps to the four cells beside."""
    seen, edge = {start}, [start]
    while edge:
        iy, ix = edge.pop()
        beside = {(iy + 1, ix), (iy - 1, ix), (iy, ix + 1), (iy, ix - 1)} - seen
        edge += [cell for cell in beside if free[cell]]
        seen.update(edge)
    return seen


SHUT = {3, 6, 7, 9, 12, 13, 18, 19}  # seeds of clutter that no way leads through


@pytest.mark.parametrize("seed", range(20))
def test_random_clutter_is_crossed_where_a_flood_gets_through_and_nowhere_else(make, seed):
    rng = np.random.default_rng(seed)
    grid, _, _ = picture(HALL)
    grid.cells[rng.random(grid.cells.shape) < 0.25] = LETHAL
    start, goal = Pose2D(*grid.info.centre_of(1, 38)), Pose2D(*grid.info.centre_of(58, 1), 0.0)
    grid.cells[38, 1] = grid.cells[1, 58] = 0
    gets_through = (1, 58) in reached(grid.cells == 0, (38, 1))
    assert gets_through == (seed not in SHUT)
    if gets_through:
        check(make().plan(copy(grid), start, goal), grid, start, goal)
    else:
        with pytest.raises(NoPath):
            make().plan(copy(grid), start, goal)
