#!/usr/bin/env python3
"""Global planning: duration of a plan, and its extra length over the shortest path.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/navigation_planning.py [--json FILE] [--quick]

plan_room7_ms, plan_corner_ms: navfn on the costmap of the tutorial's simulation: 3500 x 3500 cells of 0.01 m around the
base, inflated by 2.5 m (250 cells) with a cost_scaling_factor of 10, with all walls of worlds/house.world in it and the
rest free. Corner to corner is the slower of both diagonals; the table also has it without walls. plan_house_map_ms:
room 2 to room 7 on maps/rosbot_map.yaml with the inflation of the profile `tuned`. Each is the median of the repeats,
pinned to one core, of `plan` alone on a fresh copy of the costmap; `first` is the very first, which also loads the
kernels.

plan_excess_percent: cost of the planned path, integrated exactly along it, relative to the cheapest known path, over
random pairs of places in the three houses and in mazes, for every planner. The cheapest known path comes from a graph
of its own: Dijkstra over every cell, divided into 3 x 3, with exactly priced edges to 32 neighbours. The path is then
pulled straight wherever a straight line between two of its points is cheaper. The planned path is pulled straight in
the same way, and the cheaper one counts.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import math
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from one_core import run  # noqa: E402
from shortest_paths import path_price, path_to, pulled_straight, spread  # noqa: E402

from rosbot_patrol.costmap.bounds import Bounds  # noqa: E402
from rosbot_patrol.costmap.costs import LETHAL, costs_of_occupancy  # noqa: E402
from rosbot_patrol.costmap.footprint import Footprint, padded  # noqa: E402
from rosbot_patrol.costmap.layers.inflation import InflationLayer  # noqa: E402
from rosbot_patrol.costmap.params import InflationParams  # noqa: E402
from rosbot_patrol.geometry import Pose2D  # noqa: E402
from rosbot_patrol.grid import Grid, GridInfo  # noqa: E402
from rosbot_patrol.maps.map_io import read_map  # noqa: E402
from rosbot_patrol.planning.registry import GLOBAL_PLANNERS, make_global_planner  # noqa: E402
from rosbot_patrol.simulation.scene.floor_plan import floor_plan  # noqa: E402
from rosbot_patrol.simulation.sdf.world import load_world  # noqa: E402

AIMS = {"plan_room7_ms": 100.0, "plan_corner_ms": 350.0, "plan_house_map_ms": 25.0, "plan_excess_percent": 1.0}
ROOMS = {0: (0.0, 0.0), 2: (-3.489, 0.306), 7: (14.75, 11.48)}
CORNERS = [((-17.4, -17.4), (17.4, 17.4)), ((-17.4, 17.4), (17.4, -17.4))]
BODY = np.array([[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]])
FINER = 3  # the reference divides a cell into this many, each way


def inflated(grid: Grid, *, radius: float, factor: float, padding: float) -> Grid:
    """A grid of costs with the inflation layer's costs around its lethal cells."""
    layer = InflationLayer(InflationParams(inflation_radius=radius, cost_scaling_factor=factor))
    layer.match(grid.info, Footprint(padded(BODY, padding), BODY))
    layer.update_costs(grid.cells, Bounds(0, 0, grid.info.width, grid.info.height))
    return grid


def house_costmap(*, walls: bool = True) -> Grid:
    """The global costmap of the tutorial's simulation around the base, with every wall seen."""
    info = GridInfo(resolution=0.01, width=3500, height=3500, origin_x=-17.5, origin_y=-17.5)
    if not walls:
        return Grid(info, np.zeros(info.shape, np.uint8))
    plan = floor_plan(load_world(ROOT / "worlds" / "house.world").bodies, info, height=0.158, start=(0.0, 0.0))
    cells = np.where(plan.cells == 100, LETHAL, 0).astype(np.uint8)
    return inflated(Grid(info, cells), radius=2.5, factor=10.0, padding=0.01)


def map_costmap(name: str) -> Grid:
    """The global costmap of the profile `tuned` over one of our maps."""
    grid = read_map(ROOT / "maps" / f"{name}.yaml")
    return inflated(Grid(grid.info, costs_of_occupancy(grid.cells)), radius=0.6, factor=6.0, padding=0.03)


def plan_times(costmap: Grid, start: tuple[float, float], goal: tuple[float, float], repeats: int) -> list[float]:
    """Milliseconds of each plan by navfn; the treatment of unknown space makes no difference here."""
    planner = make_global_planner("navfn/NavfnROS", {"NavfnROS": {"allow_unknown": False}})
    times = []
    for _ in range(repeats):
        copy = Grid(costmap.info, costmap.cells.copy())
        before = time.perf_counter()
        planner.plan(copy, Pose2D(*start), Pose2D(*goal))
        times.append(1e3 * (time.perf_counter() - before))
    return times


def speed(repeats: int) -> dict[str, float]:
    """Measure plan_*_ms and print a table."""
    house, rooms = house_costmap(), map_costmap("rosbot_map")
    print(f"1 core of {os.cpu_count()}, medians of {repeats} plans")
    print(f"{'figure':34s} {'ms':>7s} {'least':>7s} {'first':>7s} {'aim':>5s}")

    def row(name: str, *pairs: tuple[Grid, tuple[float, float], tuple[float, float]]) -> float:
        slowest = max((plan_times(*pair, repeats) for pair in pairs), key=statistics.median)
        median = statistics.median(slowest)
        aim = AIMS.get(name, math.nan)
        print(f"{name:34s} {median:7.1f} {min(slowest):7.1f} {slowest[0]:7.1f} {aim:5.0f}")
        return round(median, 2)

    figures = {
        "plan_room7_ms": row("plan_room7_ms", (house, ROOMS[0], ROOMS[7])),
        "plan_corner_ms": row("plan_corner_ms", *((house, *corners) for corners in CORNERS)),
        "plan_house_map_ms": row("plan_house_map_ms", (rooms, ROOMS[2], ROOMS[7])),
    }
    row("base to room 2", (house, ROOMS[0], ROOMS[2]))
    del house
    row("corner to corner, nothing there", (house_costmap(walls=False), *CORNERS[0]))
    return figures


def maze(seed: int, *, cells: int = 12, pitch: int = 16) -> Grid:
    """Make a maze with more than one path and inflated walls."""
    rng = np.random.default_rng(seed)
    size = cells * pitch + 1
    costs = np.zeros((size, size), np.uint8)
    costs[::pitch, :] = costs[:, ::pitch] = LETHAL
    seen, stack = {(0, 0)}, [(0, 0)]
    while stack:
        x, y = stack[-1]
        ways = [(x + dx, y + dy) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        ways = [w for w in ways if min(w) >= 0 and max(w) < cells and (w not in seen or rng.random() < 0.05)]
        if not ways:
            stack.pop()
            continue
        nx, ny = ways[rng.integers(len(ways))]
        low_x, low_y = min(x, nx) * pitch, min(y, ny) * pitch
        if nx != x:
            costs[low_y + 1 : low_y + pitch, low_x + pitch] = 0
        else:
            costs[low_y + pitch, low_x + 1 : low_x + pitch] = 0
        if (nx, ny) not in seen:
            seen.add((nx, ny))
            stack.append((nx, ny))
    info = GridInfo(resolution=0.05, width=size, height=size)
    return inflated(Grid(info, costs), radius=0.3, factor=6.0, padding=0.03)


def cropped(grid: Grid, margin: int = 10) -> Grid:
    """The known part of a map."""
    known = np.argwhere(grid.cells != 255)
    (y0, x0), (y1, x1) = np.maximum(known.min(axis=0) - margin, 0), known.max(axis=0) + margin
    cells = np.ascontiguousarray(grid.cells[y0:y1, x0:x1])
    x, y = grid.info.centre_of(int(x0), int(y0))
    half = grid.info.resolution / 2.0
    height, width = cells.shape
    info = GridInfo(resolution=grid.info.resolution, width=width, height=height, origin_x=x - half, origin_y=y - half)
    return Grid(info, cells)


def excesses(costmap: Grid, plugin: str, *, starts: int, goals: int, seed: int) -> list[float]:
    """Excess cost of each planned path over the cheapest known one [%]."""
    planner = make_global_planner(plugin, {})
    table = planner.prices.astype(np.float64)
    prices = table[costmap.cells]
    fine = np.repeat(np.repeat(prices, FINER, axis=0), FINER, axis=1) / FINER
    rng = np.random.default_rng(seed)
    open_cells = np.argwhere(costmap.cells == 0)[:, ::-1]
    found = []
    for _ in range(starts):
        start = open_cells[rng.integers(len(open_cells))]
        middle = FINER // 2
        least, came = spread(fine, tuple(int(i) * FINER + middle for i in start))
        for _ in range(goals):
            goal = open_cells[rng.integers(len(open_cells))]
            fine_goal = tuple(int(i) * FINER + middle for i in goal)
            if np.hypot(*(goal - start)) < 20 or not np.isfinite(least[fine_goal[::-1]]):
                continue
            ends = [Pose2D(*costmap.info.centre_of(int(x), int(y))) for x, y in (start, goal)]
            poses = planner.plan(Grid(costmap.info, costmap.cells.copy()), *ends)
            points = (poses[:, :2] - (costmap.info.origin_x, costmap.info.origin_y)) / costmap.info.resolution
            points = points * FINER - 0.5
            ours = path_price(fine, points)
            known = min(
                path_price(fine, pulled_straight(fine, candidate)) for candidate in (points, path_to(came, fine_goal))
            )
            found.append(100.0 * (ours / known - 1.0))
    return found


def excess(pairs: int) -> dict[str, float]:
    """Measure plan_excess_percent and print a table."""
    costmaps = {name: cropped(map_costmap(name)) for name in ("rosbot_map", "office_map", "flat_map")}
    costmaps |= {f"maze {seed}": maze(seed) for seed in (1, 2)}
    print(f"{'dearer than the cheapest path, %':34s} {'pairs':>6s} {'median':>7s} {'most':>6s}")
    worst = 0.0
    for plugin in GLOBAL_PLANNERS:
        for name, costmap in costmaps.items():
            values = excesses(costmap, plugin, starts=2, goals=pairs // 2, seed=1)
            worst = max(worst, *values)
            title = f"{plugin.split('/')[-1]}, {name}"
            print(f"{title:34s} {len(values):6d} {statistics.median(values):7.2f} {max(values):6.2f}")
    return {"plan_excess_percent": round(worst, 2)}


def figures(*, quick: bool = False) -> dict[str, float]:
    """All figures of this file, by their names in FIGURES.md."""
    return {**speed(5 if quick else 25), **excess(4 if quick else 12)}


def measured(quick: bool) -> dict[str, float]:
    """Measure all figures and print them with their aims."""
    found = figures(quick=quick)
    for name, value in found.items():
        print(f"{name}: {value} (aim <= {AIMS[name]:g})")
    return found


def main() -> None:
    run(__doc__, measured)


if __name__ == "__main__":
    main()
