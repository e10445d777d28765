"""Usable beams of a scan, in the robot's frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping.beam_kernels import find_normals
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

SPAN = 0.15  # m to each side of a beam's end that give the wall's direction
STRAIGHT = 0.25  # largest spread across a wall, relative to the spread along it
THIN = 0.03  # m; largest spread across a wall
GRAZING = 8.0  # ends farther apart than this many times the spacing on a wall seen square belong to two objects
LEAST_GAP = 0.1  # m


@dataclass(frozen=True)
class Beams:
    """Beams that hit something or showed free space.

    Attributes:
        ends: where they end, or are cut at the usable range, in the robot's frame [m], shape (K, 2).
        directions: unit vectors from the sensor, shape (K, 2).
        is_hit: whether the end is a wall, shape (K,).
        sensor: position of the sensor in the robot's frame [m], shape (2,).
        spacing: angle from beam to beam [rad].
    """

    ends: Array
    directions: Array
    is_hit: NDArray[np.bool_]
    sensor: Array

    spacing: float

    @property
    def hits(self) -> Array:
        """End, direction, and the wall's unit normal (0 without a visible line) of each hit, shape (H, 6)."""
        ends = np.ascontiguousarray(self.ends[self.is_hit])
        lengths = np.hypot(*(ends - self.sensor).T)
        gaps = np.maximum(GRAZING * self.spacing * lengths, LEAST_GAP)
        normals = np.empty_like(ends)
        find_normals(ends, gaps, SPAN, STRAIGHT, THIN, normals)
        return np.ascontiguousarray(np.hstack((ends, self.directions[self.is_hit], normals)))

    @property
    def reach(self) -> float:
        """Largest distance of a beam's end from the robot [m]."""
        return float(np.hypot(*self.ends.T).max(initial=0.0))


def pick_beams(scan: LaserScan, base_from_laser: Pose2D, params: GmappingParams) -> Beams:
    """Select the beams of a level scan by the parameters.

    A beam that is NaN or shorter than `range_min` is ignored. A beam without a hit (inf, or `range_max` and more) shows
    free space up to `maxUrange` if `maxRange` is at least `range_max`; otherwise it is ignored. A scan without an upper
    limit counts as one with a `range_max` of 100 m.
    """
    longest = params.maxRange if params.maxRange > 0.0 else scan.reach - 0.01
    usable = min(params.maxUrange, longest) if params.maxUrange > 0.0 else longest
    lengths = np.minimum(scan.ranges, scan.reach)
    with np.errstate(invalid="ignore"):
        counts = (scan.ranges >= max(scan.range_min, 1e-6)) & (lengths <= longest)
    lengths = lengths[counts]
    is_miss = (scan.ranges[counts] >= scan.reach) | (lengths >= usable)
    angles = scan.angles[counts] + base_from_laser.yaw
    directions = np.column_stack((np.cos(angles), np.sin(angles)))
    sensor = np.array([base_from_laser.x, base_from_laser.y])
    ends = sensor + np.minimum(lengths, usable)[:, None] * directions
    return Beams(ends=ends, directions=directions, is_hit=~is_miss, sensor=sensor, spacing=abs(scan.angle_increment))
