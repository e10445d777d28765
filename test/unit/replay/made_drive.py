"""A drive through a made-up room as messages of a bag: scans, tf, the map, a clicked pose.

PYTHONPATH=src .ws/venv/bin/python test/unit/replay/made_drive.py test/replay/room.bag      # the bag of the repo
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from made_bag import Maker, write_bag

from rosbot_patrol.geometry import Pose2D, angle_difference, compose
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan

BEGIN = 1_600_000_000.0
# Walls as x0, y0, x1, y1 [m]: a room of 8 m x 5 m with a niche and a box in it.
WALLS = np.array(
    [
        (-4.0, -2.0, 4.0, -2.0),
        (4.0, -2.0, 4.0, 3.0),
        (4.0, 3.0, 1.0, 3.0),
        (1.0, 3.0, 1.0, 2.0),
        (1.0, 2.0, -4.0, 2.0),
        (-4.0, 2.0, -4.0, -2.0),
        (-1.8, -0.4, -1.2, -0.4),
        (-1.2, -0.4, -1.2, 0.2),
        (-1.2, 0.2, -1.8, 0.2),
        (-1.8, 0.2, -1.8, -0.4),
    ]
)
ROUND = [(2.0, 0.0), (2.4, 1.6), (-2.5, 1.2), (-3.0, -1.0), (0.0, -1.0)]
LASER = Pose2D(0.05, 0.0, math.pi)  # looks backwards
ODOM_START = Pose2D(7.0, -3.0, 1.0)


@dataclass(frozen=True)
class Moment:
    """Time since the start [s], truth and odometry."""

    time: float
    truth: Pose2D
    odometry: Pose2D


def room_map() -> Grid:
    """The walls on cells of 5 cm; floor inside, unknown outside."""
    info = GridInfo(resolution=0.05, width=180, height=120, origin_x=-4.5, origin_y=-2.5)
    y, x = np.mgrid[0 : info.height, 0 : info.width]
    x, y = info.origin_x + (x + 0.5) * 0.05, info.origin_y + (y + 0.5) * 0.05
    is_inside = (abs(x) < 4.0) & (y > -2.0) & ((y < 2.0) | ((x > 1.0) & (y < 3.0)))
    cells = np.where(is_inside, 0, -1).astype(np.int8)
    for x0, y0, x1, y1 in WALLS.tolist():
        steps = np.linspace(0.0, 1.0, 1 + round(math.hypot(x1 - x0, y1 - y0) / 0.01))
        ix = np.floor((x0 + (x1 - x0) * steps - info.origin_x) / 0.05).astype(int)
        iy = np.floor((y0 + (y1 - y0) * steps - info.origin_y) / 0.05).astype(int)
        cells[iy, ix] = 100
    return Grid(info, cells)


def ranges_at(pose: Pose2D, angles: np.ndarray) -> np.ndarray:
    """Distance to the nearest wall in each direction."""
    directions = np.column_stack((np.cos(pose.yaw + angles), np.sin(pose.yaw + angles)))
    start, along = WALLS[:, :2] - (pose.x, pose.y), WALLS[:, 2:] - WALLS[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = directions[:, None, 0] * along[None, :, 1] - directions[:, None, 1] * along[None, :, 0]
        far = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0])[None] / cross
        share = (start[None, :, 0] * directions[:, None, 1] - start[None, :, 1] * directions[:, None, 0]) / cross
    return np.where((far > 1e-9) & (share >= 0.0) & (share <= 1.0), far, np.inf).min(axis=1)


def scan_at(truth: Pose2D, stamp: float, rng: np.random.Generator, beams: int = 90) -> LaserScan:
    """What the laser measures, with 1 cm of noise."""
    step = 2.0 * math.pi / beams
    angles = -math.pi + step * np.arange(beams)
    seen = ranges_at(compose(truth, LASER), angles) + rng.normal(0.0, 0.01, beams)
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=step,
        range_min=0.1,
        range_max=12.0,
        ranges=np.where(seen < 12.0, seen, np.inf),
    )


def drive(seconds: float, *, seed: int = 1, period: float = 0.05) -> Iterator[Moment]:
    """From point to point at 0.4 m/s, turning on the spot; the wheels lie by 2 % and drift."""
    rng = np.random.default_rng(seed)
    truth, odometry, goals = Pose2D(), ODOM_START, list(ROUND)
    for i in range(round(seconds / period)):
        yield Moment(i * period, truth, odometry)
        goal = goals[0]
        if math.hypot(goal[0] - truth.x, goal[1] - truth.y) < 0.1:
            goals.append(goals.pop(0))
        bearing = angle_difference(math.atan2(goal[1] - truth.y, goal[0] - truth.x), truth.yaw)
        turn = max(-1.0, min(1.0, 2.0 * bearing)) * period
        step = Pose2D(0.4 * period if abs(bearing) < 0.4 else 0.0, 0.0, turn)
        truth = compose(truth, step)
        noise = rng.normal(0.0, 0.05, 2)
        told = Pose2D(step.x * (1.02 + noise[0]), 0.0, step.yaw * (1.01 + noise[1]) + 0.01 * step.x)
        odometry = compose(odometry, told)


def drive_messages(seconds: float, *, is2: bool = False, seed: int = 1) -> list[tuple[float, str, Any]]:
    """(time recorded [s], topic, message); tf comes 20 ms late, scans at 5 Hz 10 ms."""
    maker, rng = Maker(is2=is2), np.random.default_rng(seed)
    mount = maker.transform("base_link", "laser", BEGIN, (LASER.x, LASER.y, 0.1), (0.0, 0.0, 1.0, 0.0))
    found = [(BEGIN, "/tf_static", maker.tf(mount)), (BEGIN, "/map", maker.map(room_map()))]
    clicked = maker.initial_pose(BEGIN + 0.5, Pose2D(0.1, -0.05, 0.05), 0.04)
    found.append((BEGIN + 0.525, "/initialpose", clicked))
    for i, moment in enumerate(drive(seconds, seed=seed)):
        stamp = BEGIN + moment.time
        found.append((stamp + 0.02, "/tf", maker.tf(maker.planar("odom", "base_link", stamp, moment.odometry))))
        if i % 4 == 1:
            found.append((stamp + 0.01, "/scan", maker.scan(scan_at(moment.truth, stamp, rng))))
    return sorted(found, key=lambda each: each[0])


def truth_at(stamp: float, seconds: float, *, seed: int = 1) -> Pose2D:
    """Where the robot was at a time of the bag."""
    moments = list(drive(seconds, seed=seed))
    return moments[min(round((stamp - BEGIN) / 0.05), len(moments) - 1)].truth


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.unlink(missing_ok=True)
    write_bag(path, drive_messages(40.0), compression="BZ2", latching=["/tf_static", "/map"])
    print(path, path.stat().st_size, "bytes")
