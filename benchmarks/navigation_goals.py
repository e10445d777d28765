#!/usr/bin/env python3
"""Random goals in the three houses, half of them with a person in the way who never yields.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/navigation_goals.py [--goals 200] [--seed 1] [--house NAME]

The robot's own programs (amcl, costmaps, move_base, collision guard) run in one process with the simulator, on its
clock (`rosbot_patrol/closed_loop/loop.py`). Each goal starts where the robot stands after the last one, and has a way
in the true world that leaves the padding of 3 cm on both sides. A person walks along the robot's plan, towards it or
from behind, once; or across it, to and fro over 2.4 to 5 m. The speed is 0.5 to 1.2 m/s, and the person never stops: at
the robot they step over it, and at the end of the path they leave. A contact with a wall or a thing always counts; one
with a person counts unless the robot's wheels had stood for 0.5 s. `ideal` is the plan's length at full speed.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from rosbot_patrol.closed_loop.loop import ClosedLoop, Drive, read_profile  # noqa: E402
from rosbot_patrol.costmap.costs import INSCRIBED, LETHAL  # noqa: E402
from rosbot_patrol.errors import PlanningError, WorldError  # noqa: E402
from rosbot_patrol.geometry import Pose2D  # noqa: E402
from rosbot_patrol.grid import Grid, GridInfo  # noqa: E402
from rosbot_patrol.maps.map_io import read_map  # noqa: E402
from rosbot_patrol.planning.registry import make_global_planner  # noqa: E402
from rosbot_patrol.simulation.engine import Engine, EngineParams  # noqa: E402
from rosbot_patrol.simulation.render.egl import make_renderer  # noqa: E402
from rosbot_patrol.simulation.robot.description import load_robot  # noqa: E402
from rosbot_patrol.simulation.scene.slices import Slice, slice_bodies  # noqa: E402
from rosbot_patrol.simulation.sdf.world import World, load_world  # noqa: E402

HOUSES = {"house": "rosbot_map", "flat": "flat_map", "office": "office_map"}
FULL_SPEED = 0.36  # [m/s]
WAY = 0.17  # half the free width of a way to a goal: half the robot's width, and its padding [m]
FINE = 5  # points in a cell's edge for this width
ROOM = 0.28  # free radius around a goal: the robot's corners, its padding, and the goal tolerance [m]
HEIGHTS = (0.01, 0.04, 0.07, 0.1, 0.16, 0.2)  # heights at which the robot is checked for contact [m]
TRIES = 30  # attempts to find a goal with a path that a person can walk
BLOCK = 10  # goals from one start, with one amcl


@dataclass
class Result:
    """The result of one goal."""

    number: int
    house: str
    goal: Pose2D
    walker: str
    drive: Drive

    @property
    def reached(self) -> bool:
        """Whether move_base reports success, and the robot is there."""
        outcome = self.drive.outcome
        return outcome is not None and outcome.succeeded and self.drive.error < 0.25

    @property
    def ideal(self) -> float:
        """Time of the plan at full speed [s]."""
        return self.drive.planned / FULL_SPEED


def _gap(cut: Slice, x: float, y: float) -> float:
    """Distance from a point to the nearest obstacle of a section [m]."""
    point = np.array([x, y])
    start, end = cut.segments[:, :2], cut.segments[:, 2:]
    along = end - start
    share = ((point - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = start + share.clip(0.0, 1.0)[:, None] * along
    gaps = np.hypot(*(nearest - point).T)
    rounds = np.hypot(*(cut.circles[:, :2] - point).T) - cut.circles[:, 2]
    return min(gaps.min(initial=math.inf), rounds.min(initial=math.inf))


def _outline(cut: Slice, step: float) -> NDArray[np.float64]:
    """Points on the obstacles of a section, at most `step` apart [m], shape (N, 2)."""
    parts = [np.linspace(a[:2], a[2:], 2 + int(math.dist(a[:2], a[2:]) / step)) for a in cut.segments]
    for x, y, radius in cut.circles[:, :3]:
        turns = np.linspace(0.0, math.tau, 9 + int(math.tau * radius / step))
        parts.append(np.column_stack((x + radius * np.cos(turns), y + radius * np.sin(turns))))
    return np.concatenate(parts)


def narrow_cells(world: World, info: GridInfo) -> NDArray[np.bool_]:
    """Find the cells of a map that are nearer than WAY to an obstacle of the true world; shape (H, W)."""
    step = info.resolution / FINE
    points = np.concatenate([_outline(slice_bodies(world.bodies, height), step) for height in HEIGHTS])
    ix, iy = np.floor((points - (info.origin_x, info.origin_y)).T / step).astype(int)
    inside = (ix >= 0) & (iy >= 0) & (ix < info.width * FINE) & (iy < info.height * FINE)
    ix, iy = ix[inside], iy[inside]
    x0, y0, x1, y1 = (each // FINE for each in (ix.min(), iy.min(), ix.max(), iy.max()))  # farther out there is nothing
    is_free = np.ones(((y1 - y0 + 1) * FINE, (x1 - x0 + 1) * FINE), dtype=bool)
    is_free[iy - y0 * FINE, ix - x0 * FINE] = False
    is_narrow = np.zeros((info.height, info.width), dtype=bool)
    gaps = distance_transform_edt(is_free)[FINE // 2 :: FINE, FINE // 2 :: FINE] * step
    is_narrow[y0 : y1 + 1, x0 : x1 + 1] = gaps < WAY
    return is_narrow


def free_poses(loop: ClosedLoop, rng: np.random.Generator, is_narrow: NDArray[np.bool_]) -> Iterator[Pose2D]:
    """Places with room to turn in the true world, and reachable in the costmap by a way that is wide enough there."""
    cuts = [slice_bodies(loop.engine.world.bodies, height) for height in HEIGHTS]
    costmap = loop.global_costmap
    planner = make_global_planner("navfn/NavfnROS", {"NavfnROS": {"allow_unknown": False}})
    cells = np.where(is_narrow, np.uint8(LETHAL), costmap.cells)
    ix, iy = costmap.info.cell_of(loop.map_pose.x, loop.map_pose.y)
    near = tuple(slice(max(at - FINE, 0), at + FINE + 1) for at in (iy, ix))
    cells[near] = costmap.cells[near]  # wherever the robot stands, it can start
    free = np.argwhere(cells < INSCRIBED // 2)
    while True:
        iy, ix = free[rng.integers(len(free))]
        x, y = costmap.info.centre_of(int(ix), int(iy))
        pose = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        if math.dist((x, y), loop.map_pose[:2]) < 1.5 or min(_gap(cut, x, y) for cut in cuts) < ROOM:
            continue
        try:
            planner.plan(Grid(costmap.info, cells.copy()), loop.map_pose, pose)
        except PlanningError:
            continue
        yield pose


def _as_far_as_free(loop: ClosedLoop, start: Pose2D, yaw: float) -> Pose2D:
    """The farthest place, up to 2.5 m away in a direction, that a person can walk to."""
    costmap, end = loop.global_costmap, start
    for away in np.arange(0.1, 2.55, 0.1):
        place = Pose2D(start.x + away * math.cos(yaw), start.y + away * math.sin(yaw), yaw)
        ix, iy = costmap.info.cell_of(place.x, place.y)
        if not (0 <= ix < costmap.info.width and 0 <= iy < costmap.info.height) or costmap.cells[iy, ix] > 100:
            break
        end = place
    return end


def send_somebody(loop: ClosedLoop, goal: Pose2D, rng: np.random.Generator) -> str:
    """Send a person into the robot's way; returns how, or "" if there is no room."""
    engine, costmap = loop.engine, loop.global_costmap
    planner = make_global_planner("navfn/NavfnROS", {"NavfnROS": {"allow_unknown": False}})
    plan = planner.plan(Grid(costmap.info, costmap.cells.copy()), loop.map_pose, goal)[:, :2]
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(plan, axis=0).T))))
    if along[-1] < 2.5:
        return ""

    def at(way: float) -> Pose2D:
        return Pose2D(*(float(np.interp(way, along, plan[:, k])) for k in (0, 1)))

    kind = ("towards", "behind", "across")[int(rng.integers(3))]
    speed = float(rng.uniform(0.5, 1.2))
    far = min(float(along[-1]), float(rng.uniform(2.5, 7.0)))
    if kind == "towards":
        ways = [at(w) for w in np.arange(far, -1e-6, -0.5)]
    elif kind == "behind":
        ways = [at(w) for w in np.arange(0.0, far + 1e-6, 0.5)]
        heading = math.atan2(ways[1].y - ways[0].y, ways[1].x - ways[0].x)
        ways = [_as_far_as_free(loop, ways[0], heading + math.pi), *ways[1:]]
    else:
        middle, ahead = at(far / 2.0), at(far / 2.0 + 0.3)
        yaw = math.atan2(ahead.y - middle.y, ahead.x - middle.x) + math.pi / 2.0
        ways = [_as_far_as_free(loop, middle, yaw + turn) for turn in (math.pi, 0.0)]
        if min(math.dist(way[:2], middle[:2]) for way in ways) < 1.2:
            return ""  # turning this close, they would walk over the robot without end
    start = ways[0]
    if math.dist(start[:2], engine.pose[:2]) < 1.5:
        return ""
    heading = math.atan2(ways[1].y - start.y, ways[1].x - start.x)
    try:
        engine.population.spawn_actor("somebody", "person", "", Pose2D(start.x, start.y, heading))
    except WorldError:
        return ""
    try:
        loops = kind == "across"
        path = [*ways[1:], *([start] if loops else [])]
        engine.population.move_actor("somebody", path, speed, loop=loops, pause=1.0 if loops else 0.0, yields=False)
    except WorldError:
        engine.population.remove("somebody")
        return ""
    return f"{kind} {speed:.1f} m/s"


def see_out(engine: Engine, *, always: bool = False) -> None:
    """Remove a person who has reached the end of the path."""
    for actor in engine.population.walkers:
        if actor.name == "somebody" and (always or actor.has_arrived):
            engine.population.remove("somebody")


def drives(house: str, count: int, seed: int, *, only_block: int | None = None) -> Iterator[Result]:
    """Drive to goals in one house."""
    known = read_map(ROOT / "maps" / f"{HOUSES[house]}.yaml")
    world = load_world(ROOT / "worlds" / f"{house}.world")
    params = read_profile(ROOT / "config" / "tuned")
    is_narrow = narrow_cells(world, known.info)
    for first in range(0, count, BLOCK):
        if only_block not in (None, first // BLOCK):
            continue
        rng = np.random.default_rng([seed, sum(map(ord, house)), first])
        engine = Engine(world, EngineParams(seed=seed + first), make_renderer=make_renderer)
        engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
        loop = ClosedLoop(engine, known, params, seed=seed + first)
        loop.drive_to(Pose2D(0.0, 0.0, 1.5), 20.0)
        for number in range(first, min(first + BLOCK, count)):
            goals = free_poses(loop, rng, is_narrow)
            goal, walker = next(goals), ""
            for _ in range(TRIES if number % 2 else 0):
                if walker := send_somebody(loop, goal, rng):
                    break
                goal = next(goals)  # no room for a person on the path
            drive = loop.drive_to(goal, 240.0, each_step=partial(see_out, engine))
            see_out(engine, always=True)
            yield Result(number, house, goal, walker, drive)
        engine.close()


def main() -> None:
    """Drive, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goals", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--house", choices=list(HOUSES), action="append")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    houses = args.house or list(HOUSES)
    results: list[Result] = []
    clock = time.perf_counter()
    for i, house in enumerate(houses):
        count = args.goals // len(houses) + (i < args.goals % len(houses))
        for result in drives(house, count, args.seed):
            results.append(result)
            tell(result)
    in_workspace.require_figures(results, "no goal was driven to")
    wall = time.perf_counter() - clock
    figures = summary(results)
    simulated = sum(r.drive.seconds for r in results)
    print(f"\n{len(results)} goals, {simulated:.0f} simulated s in {wall:.0f} s of wall time ({simulated / wall:.1f}x)")
    print("\n| figure | value |\n|---|---|")
    for name, value in figures.items():
        print(f"| {name} | {value:.3g} |")
    if args.json:
        args.json.write_text(json.dumps(figures, indent=1))


def tell(result: Result) -> None:
    """Print one line for a goal."""
    drive = result.drive
    end = drive.outcome.text if drive.outcome else "timed out"
    line = f"{result.house} {result.number}: {'reached' if result.reached else 'NOT REACHED: ' + end}"
    line += f" {drive.seconds:.0f} s, ideal {result.ideal:.0f}, off {drive.error:.2f} m"
    if result.walker:
        line += f", somebody {result.walker}, waited {drive.waited:.0f} s"
    for when, kind, name in drive.contacts:
        line += f", TOUCHED {kind} '{name}' at {when:.2f}"
    if drive.recoveries:
        line += f", recoveries {drive.recoveries}"
    if not result.reached:
        line += f", {drive.reasons[-4:]}, goal {tuple(round(v, 2) for v in result.goal)}"
    print(line, flush=True)


def summary(results: list[Result]) -> dict[str, float]:
    """The figures of FIGURES.md and some more."""
    touched = [kind for r in results for _, kind, _ in r.drive.contacts]
    ratios = [r.drive.seconds / max(r.ideal, 1.0) for r in results if r.reached]
    alone = [r.drive.seconds / max(r.ideal, 1.0) for r in results if r.reached and not r.walker]
    return {
        "goals_reached_rate": sum(r.reached for r in results) / len(results),
        "contacts": len(touched),
        "contacts_person": sum(kind == "person" for kind in touched),
        "contacts_other": sum(kind != "person" for kind in touched),
        "with_somebody": sum(bool(r.walker) for r in results),
        "time_over_ideal_median": float(np.median(ratios)) if ratios else math.nan,
        "time_over_ideal_alone_median": float(np.median(alone)) if alone else math.nan,
        "goals_with_recoveries": sum(bool(r.drive.recoveries) for r in results),
    }


if __name__ == "__main__":
    main()
