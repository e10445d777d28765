"""A drive through the house for tests: rays on a fine plan of it, noise, and wheels that lie."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from rosbot_patrol.amcl.scan_model.field_kernels import cast_ray
from rosbot_patrol.amcl.scan_model.likelihood_field import Field, blocked_distances
from rosbot_patrol.geometry import Pose2D, angle_difference, compose, invert
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.simulation.scene.floor_plan import floor_plan
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).parents[3]
MOUNT = Pose2D(0.02, 0.0, math.pi)
START = Pose2D()
ROUND = [(-0.6, 2.5), (-1.2, 4.8), (2.7, 7.35), (-2.5, 6.5), (-4.0, 4.0), (-1.0, 4.5), (-0.4, 2.5), (0.0, 0.0)]


def plan(resolution: float) -> Grid:
    """The house at the lidar's height."""
    size = {"width": round(28.0 / resolution), "height": round(21.0 / resolution)}
    info = GridInfo(resolution=resolution, origin_x=-9.0, origin_y=-4.0, **size)
    return floor_plan(load_world(ROOT / "worlds" / "house.world").bodies, info, height=0.158, start=(0.0, 0.0))


@lru_cache(maxsize=1)
def house_map() -> Grid:
    """A map without a fault, in the cells of the maps that we ship."""
    return plan(0.05)


@lru_cache(maxsize=1)
def truth_field() -> Field:
    """Where rays end: the house on a grid of 2 cm."""
    return blocked_distances(plan(0.02), 3.0)


def scan_at(
    pose: Pose2D, rng: np.random.Generator, *, stamp: float = 0.0, beams: int = 120, reach: float = 12.0
) -> LaserScan:
    """What the lidar sees from a pose of the robot, with 1 cm of noise."""
    laser, field = compose(pose, MOUNT), truth_field()
    angles = np.linspace(-math.pi, math.pi, beams)
    ranges = np.array(
        [
            cast_ray(
                laser.x,
                laser.y,
                laser.yaw + a,
                field.values,
                field.origin_x,
                field.origin_y,
                field.resolution,
                reach,
            )
            for a in angles.tolist()
        ]
    )
    ranges += rng.normal(0.0, 0.01, beams)
    ranges[ranges > reach - 0.1] = np.inf
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=2.0 * math.pi / (beams - 1),
        range_min=0.2,
        range_max=reach,
        ranges=ranges,
    )


@dataclass(frozen=True)
class Moment:
    """Truth, odometry and scan of one instant."""

    truth: Pose2D
    odometry: Pose2D
    scan: LaserScan


def drive(points: list[tuple[float, float]] = ROUND, *, start: Pose2D = START, seed: int = 1) -> Iterator[Moment]:
    """Drive from point to point at 0.3 m/s with ten scans in 2 s; the wheels lie by 2 % and drift to one side."""
    rng = np.random.default_rng(seed)
    truth, odometry, stamp = start, Pose2D(7.0, -3.0, 1.0), 0.0
    yield Moment(truth, odometry, scan_at(truth, rng, stamp=stamp))
    for goal in points:
        while math.hypot(goal[0] - truth.x, goal[1] - truth.y) > 0.1:
            bearing = angle_difference(math.atan2(goal[1] - truth.y, goal[0] - truth.x), truth.yaw)
            turn = max(-0.2, min(0.2, bearing))
            step = Pose2D(0.06 if abs(bearing) < 0.4 else 0.0, 0.0, turn)
            truth = compose(truth, step)
            told = Pose2D(
                step.x * 1.02 + rng.normal(0.0, 0.03 * step.x + 1e-9),
                rng.normal(0.0, 0.01 * step.x + 1e-9),
                step.yaw * 1.02 + 0.02 * step.x + rng.normal(0.0, 0.03 * abs(step.yaw) + 0.05 * step.x),
            )
            odometry, stamp = compose(odometry, told), stamp + 0.2
            yield Moment(truth, odometry, scan_at(truth, rng, stamp=stamp))


def error(estimate: Pose2D, truth: Pose2D) -> tuple[float, float]:
    """Distance [m] and turn [rad] between two poses."""
    off = compose(invert(truth), estimate)
    return math.hypot(off.x, off.y), abs(off.yaw)
