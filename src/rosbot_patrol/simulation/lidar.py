"""A planar laser scanner that turns about its own axis, in the plane of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.params import param
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.simulation.slices import Slice


@dataclass(frozen=True, kw_only=True)
class LidarParams:
    """The scanner; defaults as the ros1 branch of the robot's description has it."""

    samples: int = param(720, lo=2, hi=10000, doc="beams a turn, the first at -pi, the last at pi")
    range_min: float = param(0.2, unit="m", lo=0.0, doc="nearer is -inf (REP 117)")
    range_max: float = param(12.0, unit="m", lo=0.01, doc="farther is inf")
    noise: float = param(0.01, unit="m", lo=0.0, doc="standard deviation of a range")
    height_offset: float = param(0.06, unit="m", doc="height of the beams above the frame 'laser'")


def measure_scan(
    params: LidarParams, scene: Slice, world_from_laser: Pose2D, stamp: float, rng: np.random.Generator | None
) -> LaserScan:
    """One sweep.

    Args:
        params: the scanner.
        scene: the cut through the world at the height of the beams.
        world_from_laser: where the scanner is.
        stamp: time of the sweep [s].
        rng: for the noise, None for none.
    """
    step = math.tau / (params.samples - 1)
    x, y, yaw = world_from_laser
    ranges = scene.cast(x, y, yaw - math.pi, step, params.samples, math.inf)
    hit = np.isfinite(ranges)
    if rng is not None and params.noise > 0.0:
        ranges[hit] += rng.normal(0.0, params.noise, params.samples)[hit]
    ranges[ranges > params.range_max] = math.inf
    ranges[ranges < params.range_min] = -math.inf
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=step,
        range_min=params.range_min,
        range_max=params.range_max,
        ranges=ranges,
    )
