"""A planar laser scanner that rotates about its own axis, in the plane of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, compose
from rosbot_patrol.params import param
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.simulation.scene.slices import Slice

_SECTORS = 36  # number of parts in which a sweep with duration is cast
_BEYOND = 1.0  # range of a beam without return beyond the maximum, if it must be a number [m]


@dataclass(frozen=True, kw_only=True)
class LidarParams:
    """Parameters of the lidar; defaults as in the ros1 branch of the robot's description."""

    samples: int = param(720, lo=2, hi=10000, doc="number of beams in a scan")
    angle_min: float = param(-math.pi, unit="rad", lo=-math.pi, hi=math.pi, doc="direction of the first beam")
    angle_max: float = param(math.pi, unit="rad", lo=-math.pi, hi=math.pi, doc="direction of the last beam")
    range_min: float = param(0.2, unit="m", lo=0.0, doc="minimum range; shorter ones are -inf (REP 117)")
    range_max: float = param(12.0, unit="m", lo=0.01, doc="maximum range; longer ones are no return")
    resolution: float = param(0.01, unit="m", lo=0.0, doc="step of the ranges; 0: not rounded")
    noise: float = param(0.01, unit="m", lo=0.0, doc="standard deviation of a range")
    no_return: str = param(
        "inf", choices=("inf", "beyond"), doc="range of a beam without return: inf, or range_max + 1 m"
    )
    dropped: float = param(0.0, lo=0.0, hi=1.0, doc="share of the beams that lose their return by chance")
    dropped_as: str = param("inf", choices=("inf", "zero"), doc="range of such a beam: as without return, or 0")
    sweep_time: float = param(
        0.0, unit="s", lo=0.0, hi=1.0, doc="duration of a scan; motion during it distorts the scan"
    )
    height_offset: float = param(0.0, unit="m", doc="height of the beams above the lidar's link")


def measure_scan(
    params: LidarParams,
    scene: Slice,
    world_from_laser: Pose2D,
    stamp: float,
    rng: np.random.Generator | None,
    *,
    frame: str = "laser",
    twist: Twist2D = STOP,
    flipped: bool = False,
) -> LaserScan:
    """Take one sweep.

    Args:
        params: the scanner.
        scene: section through the world at the height of the beams.
        world_from_laser: pose of the scanner at the end of the sweep.
        stamp: time of the end of the sweep [s].
        rng: for noise and dropped beams, None for none.
        frame: frame of the scan.
        twist: velocity of the scanner in its own frame, for a sweep with duration.
        flipped: whether it is mounted upside down.
    """
    p = params
    step = (p.angle_max - p.angle_min) / (p.samples - 1)
    ranges = _lengths(p, scene, world_from_laser, step, twist=twist, flipped=flipped)
    if rng is not None:
        noise = rng.normal(0.0, p.noise, p.samples) if p.noise > 0.0 else 0.0
        ranges += noise  # inf stays inf
    if p.resolution > 0.0:
        ranges = np.rint(ranges / p.resolution) * p.resolution
    ranges[ranges < p.range_min] = -math.inf
    lost = math.inf if p.no_return == "inf" else p.range_max + _BEYOND
    ranges[ranges > p.range_max] = lost
    if rng is not None and p.dropped > 0.0:
        ranges[rng.random(p.samples) < p.dropped] = lost if p.dropped_as == "inf" else 0.0
    return LaserScan(
        stamp=stamp - p.sweep_time,
        frame_id=frame,
        angle_min=p.angle_min,
        angle_increment=step,
        range_min=p.range_min,
        range_max=p.range_max,
        ranges=ranges,
    )


def _lengths(
    p: LidarParams, scene: Slice, pose: Pose2D, step: float, *, twist: Twist2D, flipped: bool
) -> NDArray[np.float64]:
    """Lengths of the beams, before limits [m], shape (samples,)."""
    sectors = _SECTORS if p.sweep_time > 0.0 and twist != STOP else 1
    edges = np.linspace(0, p.samples, sectors + 1).round().astype(int)
    ranges = np.empty(p.samples)
    for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        ago = p.sweep_time * (1.0 - (low + high) / (2.0 * p.samples)) if sectors > 1 else 0.0
        x, y, yaw = compose(pose, Pose2D(-twist.vx * ago, -twist.vy * ago, -twist.wz * ago))
        if flipped:  # its angles run clockwise: cast from the last beam to the first
            first = yaw - (p.angle_min + (high - 1) * step)
            ranges[low:high] = scene.cast(x, y, first, step, high - low, longest=math.inf)[::-1]
        else:
            ranges[low:high] = scene.cast(x, y, yaw + p.angle_min + low * step, step, high - low, longest=math.inf)
    return ranges
