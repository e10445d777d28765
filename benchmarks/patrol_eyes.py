#!/usr/bin/env python3
"""Cost of the patrol's perception: coverage, lidar motion, boxes with depth, viewpoints, the floor of our largest
house.

    python3 benchmarks/patrol_eyes.py [--json FILE]

It runs on one core, in this process, over the office's map from its largest room. Each part is also given as its share
of a core at the rates of a mission: 10 pictures and 10 scans a second (lidar motion uses 5), a box in each picture.
Received depth pictures (1.2 MB each) also cost time in rospy, in the seconds with somebody in view.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import math
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.house.floor import Floor, floor_of
from rosbot_patrol.patrol.house.regions import part_rooms
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.patrol.intruder.lidar_motion import LidarMotion
from rosbot_patrol.patrol.intruder.measure import Depth, Lens, View, measure
from rosbot_patrol.patrol.records.inputs import Box, Eye
from rosbot_patrol.patrol.visibility.coverage import Coverage, sight_of_scan, sight_on_map
from rosbot_patrol.patrol.visibility.viewpoints import ViewpointPlanner
from rosbot_patrol.scan import LaserScan

ROOT = Path(__file__).resolve().parents[1]
LENS = Lens(fx=554.38, fy=554.38, cx=319.5, cy=239.5, width=640, height=480)
ROOM = 3


def milliseconds(work: Callable[[], object], repeats: int) -> float:
    """Median of some runs, after a warm-up run."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - began))
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures here")
    arguments = parser.parse_args()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    figures = measure_all()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    for name, value in figures.items():
        print(f"{name:28s} {value:8.3f}")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")


def measure_all() -> dict[str, float]:
    """Measure all figures."""
    grid, rooms = read_map(ROOT / "maps" / "office_map.yaml"), load_rooms(ROOT / "params" / "office_room_points.yaml")
    floor = floor_of(grid)
    regions = part_rooms(floor, rooms)
    room = rooms.find(ROOM)
    assert room is not None
    pose, mask = room.pose, regions.mask(ROOM)
    sight = sight_on_map(floor, pose.x, pose.y, 12.0)
    angles = math.tau / 720 * np.arange(720)
    lengths = sight.lengths[np.rint(angles / sight.step).astype(int) % len(sight.lengths)]
    scans = [one_scan(lengths, angles, 0.1 * k) for k in range(200)]
    figures = {
        "floor_ms": milliseconds(lambda: floor_of(grid), 10),
        "regions_ms": milliseconds(lambda: part_rooms(floor, rooms), 10),
        "coverage_ms": coverage_ms(floor, mask, pose, scans[0]),
        "witness_ms": witness_ms(floor, scans),
        "box_ms": box_ms(),
        "viewpoint_ms": milliseconds(lambda: ViewpointPlanner(floor).next(pose, mask, mask, width=LENS.view_width), 10),
    }
    rates = {"coverage": 10.0, "witness": 10.0, "box": 10.0}
    figures |= {f"{name}_percent": 0.1 * figures[f"{name}_ms"] * rate for name, rate in rates.items()}
    return figures


def one_scan(lengths: np.ndarray, angles: np.ndarray, stamp: float) -> LaserScan:
    """A scan of the room with somebody who walks around the robot."""
    bearing = 0.5 * stamp
    ranges = lengths.copy()
    near = np.abs((angles - bearing + math.pi) % math.tau - math.pi) < 0.07
    ranges[near] = np.minimum(ranges[near], 1.8)
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=math.tau / len(angles),
        range_min=0.1,
        range_max=12.0,
        ranges=ranges,
    )


def coverage_ms(floor: Floor, mask: np.ndarray, pose: Pose2D, scan: LaserScan) -> float:
    """Time per picture of a turn, each with its own scan; the mean, because it falls with the area already seen."""
    coverage = Coverage(floor, mask)
    at = Pose2D(pose.x, pose.y, 0.0)
    began = time.perf_counter()
    for k in range(84):
        sight = sight_of_scan(scan, at, floor, coverage.params.view_range)
        coverage.look(Eye(pose=at._replace(yaw=math.tau * k / 84), width=LENS.view_width), sight)
    return 1e3 * (time.perf_counter() - began) / 84


def witness_ms(floor: Floor, scans: list[LaserScan]) -> float:
    """Time per scan, with the skipped ones included."""
    room = Pose2D(4.2, 2.3, 0.0)
    witness = LidarMotion()
    began = time.perf_counter()
    for scan in scans:
        witness.see(scan, room, floor)
    return 1e3 * (time.perf_counter() - began) / len(scans)


def box_ms() -> float:
    """Time of a box with depth."""
    pose = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.22], [0.0, 0.0, 0.0, 1.0]])
    rows, columns = np.mgrid[0:480, 0:640]
    metres = (3.0 + 0.1 * np.sin(columns / 20.0) + 0.05 * np.sin(rows / 30.0)).astype(np.float32)
    box = Box(label="person", probability=0.9, xmin=250, ymin=20, xmax=380, ymax=300)
    view, depth = View(LENS, pose), Depth(metres, LENS)
    return milliseconds(lambda: measure(box, view, depth), 200)


if __name__ == "__main__":
    main()
