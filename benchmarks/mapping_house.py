"""The house mapped by slam_gmapping, without ROS: a drive through all its rooms, and the map against the true walls.

The robot follows the shortest paths from room to room at 0.3 m/s, with 1 cm of noise on 720 beams of 12 m at 10 Hz, and
with odometry errors as in the logs. The wall figures are from `map_truth.py`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import heapq
import itertools
import math
import re
import resource
import statistics
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from map_truth import map_figures, plan
from numpy.typing import NDArray

from rosbot_patrol.amcl.scan_model.field_kernels import cast_ray
from rosbot_patrol.amcl.scan_model.likelihood_field import Field, blocked_distances
from rosbot_patrol.geometry import Pose2D, angle_difference, compose
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.slam import Slam
from rosbot_patrol.gmapping.start import started
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.distance_kernels import bounded_distances
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.maps.occupancy import FREE, OCCUPIED
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.replay.bags.carmen import noisy_odometry
from rosbot_patrol.scan import LaserScan

ROOT = Path(__file__).resolve().parents[1]
MOUNT = Pose2D(0.02, 0.0, math.pi)
BEAMS, REACH, NOISE = 720, 12.0, 0.01
SPEED, TURNING, RATE = 0.3, 0.8, 10.0
CLEARANCE = 0.4  # m, smallest distance of the paths from walls
BOUNDS = (-9.0, -4.0), (19.0, 17.0)
WORLD = ROOT / "worlds" / "house.world"
MOVED = {"coffee_table_7": (1.6, -0.2), "sofa_1": (-1.4, 0.37)}  # pieces of furniture and how far they are moved [m]

Poses = NDArray[np.float64]


def way_between(clear: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]]:
    """Find the shortest path over clear cells (Dijkstra, eight neighbours)."""
    costs, came, queue = {start: 0.0}, {start: start}, [(0.0, start)]
    while queue:
        cost, at = heapq.heappop(queue)
        if at == goal:
            break
        for dx, dy in itertools.product((-1, 0, 1), repeat=2):
            cell, further = (at[0] + dx, at[1] + dy), cost + math.hypot(dx, dy)
            if clear[cell[1], cell[0]] and further < costs.get(cell, math.inf):
                costs[cell], came[cell] = further, at
                heapq.heappush(queue, (further, cell))
    if goal not in came:
        raise SystemExit(f"no way from cell {start} to {goal}")
    way = [goal]
    while way[-1] != start:
        way.append(came[way[-1]])
    return way[::-1]


def waypoints(rooms: list[tuple[float, float]], world: Path = WORLD) -> list[tuple[float, float]]:
    """Points of the path from room to room, one every 0.4 m."""
    grid = plan(world, BOUNDS, 0.1)
    clear = bounded_distances(grid.cells != FREE, 10) * 0.1 > CLEARANCE
    points: list[tuple[float, float]] = []
    for start, goal in itertools.pairwise(rooms):
        cells = way_between(clear, grid.info.cell_of(*start), grid.info.cell_of(*goal))
        points += [grid.info.centre_of(*cell) for cell in cells[::4]]
    return points


def drive(points: list[tuple[float, float]]) -> Poses:
    """The robot's true pose at each scan, shape (N, 3)."""
    pose, rows = Pose2D(), [Pose2D()]
    for goal in points:
        while math.hypot(goal[0] - pose.x, goal[1] - pose.y) > 0.1:
            bearing = angle_difference(math.atan2(goal[1] - pose.y, goal[0] - pose.x), pose.yaw)
            turn = max(-TURNING / RATE, min(TURNING / RATE, bearing))
            pose = compose(pose, Pose2D(SPEED / RATE if abs(bearing) < 0.4 else 0.0, 0.0, turn))
            rows.append(pose)
    return np.array(rows)


def scans(poses: Poses, field: Field, rng: np.random.Generator) -> Iterator[LaserScan]:
    """The lidar's scan at each pose."""
    angles = np.linspace(-math.pi, math.pi, BEAMS)
    for i, row in enumerate(poses):
        laser = compose(Pose2D(*row), MOUNT)
        place = (field.values, field.origin_x, field.origin_y, field.resolution, REACH)
        ranges = np.array([cast_ray(laser.x, laser.y, laser.yaw + a, *place) for a in angles.tolist()])
        seen = ranges < REACH
        yield LaserScan(
            stamp=i / RATE,
            frame_id="laser",
            angle_min=-math.pi,
            angle_increment=2.0 * math.pi / (BEAMS - 1),
            range_min=0.2,
            range_max=REACH,
            ranges=np.where(seen, ranges + rng.normal(0.0, NOISE, BEAMS), np.inf),
        )


def rearranged(folder: Path) -> Path:
    """Write the world with the pieces of `MOVED` at other places."""
    text = WORLD.read_text(encoding="utf-8")
    for name, (dx, dy) in MOVED.items():
        found = re.search(rf'<model name="{name}">.*?<pose>(\S+) (\S+) ', text, re.DOTALL)
        assert found is not None, name
        place = f"{float(found[1]) + dx:g} {float(found[2]) + dy:g}"
        text = f"{text[: found.start(1)]}{place}{text[found.end(2) :]}"
    path = folder / "rearranged.world"
    path.write_text(text, encoding="utf-8")
    return path


def measure_moved(params: GmappingParams, saved: Grid, folder: Path) -> tuple[dict[str, float], Grid]:
    """The saved map gone on with after `MOVED`: what is left of the old places, what is found at the new ones."""
    world = rearranged(folder)
    with contextlib.chdir(folder):
        write_map("saved", saved)
    rooms = [(room.pose.x, room.pose.y) for room in load_rooms(ROOT / "params" / "room_points.yaml")]
    poses = drive(waypoints([rooms[0], *rooms[1:], rooms[0]], world))
    field = blocked_distances(plan(world, BOUNDS, 0.02), 3.0)
    odometry = noisy_odometry(poses, np.random.default_rng(3))
    slam = started(dataclasses.replace(params, map_file=str(folder / "saved.yaml")))
    for scan, row in zip(scans(poses, field, np.random.default_rng(4)), odometry, strict=True):
        slam.update(scan, Pose2D(*row), MOUNT)
    found = slam.grid()
    cell = found.info.resolution
    old, new = (plan(which, BOUNDS, cell) for which in (WORLD, world))
    steps = [round((a - b) / cell) for a, b in zip(BOUNDS[0], (found.info.origin_x, found.info.origin_y), strict=True)]
    now = found.cells[steps[1] : steps[1] + old.info.height, steps[0] : steps[0] + old.info.width]
    was = bounded_distances(saved.cells == OCCUPIED, 10)
    shift = [round((a - b) / cell) for a, b in zip(BOUNDS[0], (saved.info.origin_x, saved.info.origin_y), strict=True)]
    had = was[shift[1] : shift[1] + old.info.height, shift[0] : shift[0] + old.info.width] < 0.5
    gone = had & (old.cells == OCCUPIED) & (new.cells == FREE) & (bounded_distances(new.cells == OCCUPIED, 10) > 2.0)
    figures = {"moved_left": float(np.mean(now[gone] == OCCUPIED)), "moved_cells": float(gone.sum())}
    walls = map_figures(found, world, BOUNDS)
    return {**figures, "moved_wall_f1": round(walls.f1, 4), "moved_wall_error_m": round(walls.error_m, 4)}, found


def wall_figures(found: Grid) -> dict[str, float]:
    """Compare the map's walls with the true ones."""
    figures = map_figures(found, WORLD, BOUNDS)
    return {
        "house_wall_f1": round(figures.f1, 4),
        "house_wall_precision": round(figures.precision, 4),
        "house_wall_recall": round(figures.recall, 4),
        "house_wall_error_m": round(figures.error_m, 4),
    }


def measure_house(params: GmappingParams, *, quick: bool) -> tuple[dict[str, float], Grid, Poses, Poses]:
    """Figures of the drive, its map, the trajectory as estimated at each update, and the true one."""
    rooms = [(room.pose.x, room.pose.y) for room in load_rooms(ROOT / "params" / "room_points.yaml")]
    poses = drive(waypoints([rooms[0], *([rooms[1]] if quick else rooms[1:]), rooms[0]]))
    field = blocked_distances(plan(WORLD, BOUNDS, 0.02), 3.0)
    odometry = noisy_odometry(poses, np.random.default_rng(1))
    slam, times, spent = Slam(params), [], 0.0
    for scan, row in zip(scans(poses, field, np.random.default_rng(2)), odometry, strict=True):
        before = time.perf_counter()
        updated = slam.update(scan, Pose2D(*row), MOUNT).updated
        took = time.perf_counter() - before
        spent += took
        times += [1e3 * took] if updated else []
    grid = slam.grid()
    print(f"house: {len(poses)} scans, {len(times)} updates, longest {max(times):.1f} ms, {slam.maps.megabytes:.0f} MB")
    figures = {
        "gmapping_update_ms": round(statistics.median(times), 2),
        "gmapping_rtf": round(len(poses) / RATE / spent, 2),
        "gmapping_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, 1),
    }
    return figures | wall_figures(grid), grid, slam.trajectory, poses
