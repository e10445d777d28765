"""Scans as the obstacle layer uses them, and the buffer of those that still count."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.sensor_params import SourceParams
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.scan import LaserScan, LevelScan

Array = NDArray[np.float64]

_EPSILON = 1e-4  # upstream shortens range_max by this for a beam without a hit [m]
_HAIR = 1e-6  # of heights: rounding of a transform [m]


@dataclass(frozen=True)
class View:
    """Free distance along each beam of a scan.

    Attributes:
        start: bearing of the first beam in the costmap's frame [rad].
        increment: from beam to beam [rad].
        clear: free distance [m], inf without a hit, 0 if unknown; shape (N,).
    """

    start: float
    increment: float
    clear: Array

    def free_to(self, bearings: Array) -> Array:
        """Distance certainly free in the directions `bearings` [rad]: the shorter of the two neighbouring beams."""
        if len(self.clear) == 0 or self.increment == 0.0:
            return np.zeros(len(bearings))
        period = math.tau / abs(self.increment)
        at = np.mod((bearings - self.start) / self.increment, period)
        first = np.floor(at).astype(np.int64)
        second = first + 1
        count = len(self.clear)
        if count >= period - 1.5:  # all around
            nearer: Array = np.minimum(self.clear[first % count], self.clear[second % count])
            return nearer
        known = second < count
        return np.where(known, np.minimum(self.clear[first % count], self.clear[second % count]), 0.0)


@dataclass(frozen=True, kw_only=True)
class Observation:
    """A scan in the costmap's frame.

    Attributes:
        stamp: when it was measured [s].
        sensor: its position (x, y) [m].
        hits: points that were hit, shape (N, 2).
        ends: end points of the free rays, shape (M, 2).
        height: of the points above the ground [m].
        view: free distance of each beam, None if unknown.
    """

    stamp: float
    sensor: tuple[float, float]
    hits: Array
    ends: Array
    height: float = 0.1
    view: View | None = None


def observe(scan: LaserScan, pose: Pose2D, *, inf_is_valid: bool = False, height: float = 0.1) -> Observation:
    """Turn a level scan, taken at `pose` (of the sensor, in the costmap's frame), into an observation.

    Beams outside the scan's own limits, range_max included, are ignored, as in laser_geometry. With `inf_is_valid` a
    beam without a hit clears up to range_max, or 100 m for a scan without an upper limit.

    Differs: upstream marks the end of such a beam if obstacle_range reaches that far; here it never marks.
    """
    angles = scan.angles
    units = np.column_stack((np.cos(angles), np.sin(angles)))
    hit = scan.is_hit & (scan.ranges < scan.range_max)
    hits = transform_points(pose, units[hit] * scan.ranges[hit, None])
    ends = hits
    is_open = np.isposinf(scan.ranges)
    if inf_is_valid:
        far = transform_points(pose, units[is_open] * (scan.reach - _EPSILON))
        ends = np.concatenate((hits, far))
    clear = np.where(hit, scan.ranges, np.where(is_open, np.inf, 0.0))
    return Observation(
        stamp=scan.stamp,
        sensor=(pose.x, pose.y),
        hits=np.ascontiguousarray(hits),
        ends=np.ascontiguousarray(ends),
        height=height,
        view=View(scan.angle_min + pose.yaw, scan.angle_increment, clear),
    )


def observe_level(level: LevelScan, source: SourceParams, top: float = math.inf) -> Observation:
    """Turn a scan, laid level in the costmap's frame, into an observation.

    Points of a tilted laser have heights of their own: those outside the source's limits neither mark nor clear, as in
    costmap_2d::ObservationBuffer.

    Args:
        level: the scan.
        source: its limits.
        top: the layer's `max_obstacle_height` [m]: higher points clear and do not mark.
    """
    scan = level.scan
    if level.rises is None:
        return observe(scan, level.pose, inf_is_valid=source.inf_is_valid, height=level.height)
    lengths = np.where(np.isposinf(scan.ranges), scan.reach, scan.ranges)
    with np.errstate(invalid="ignore"):
        heights = level.height + level.rises * lengths
        counts = (heights >= source.min_obstacle_height) & (heights <= source.max_obstacle_height)
    inside = replace(scan, ranges=np.where(counts, scan.ranges, math.nan))
    marked = replace(scan, ranges=np.where(counts & (heights <= top), scan.ranges, math.nan))
    seen = observe(inside, level.pose, inf_is_valid=source.inf_is_valid)
    height = min(max(level.height, source.min_obstacle_height), source.max_obstacle_height, top)
    return replace(seen, hits=observe(marked, level.pose).hits, height=height)


def height_problem(level: LevelScan, source: SourceParams) -> str:
    """Reason why a source ignores a scan, "" if it does not: upstream then ignores it in silence."""
    low, high = source.min_obstacle_height, source.max_obstacle_height
    if level.rises is not None or low - _HAIR <= level.height <= high + _HAIR:
        return ""
    return (
        f"the laser '{level.scan.frame_id}' is {level.height:.2f} m high in the costmap's frame, outside"
        f" min_obstacle_height {low:g} to max_obstacle_height {high:g}: its scan would mark and clear nothing"
    )


class ObservationBuffer:
    """The observations of one source that are still used."""

    def __init__(self, params: SourceParams) -> None:
        self.params = params
        self._kept: list[Observation] = []
        self._last = float("-inf")

    def add(self, observation: Observation) -> None:
        """Store an observation; older ones are dropped as `observation_persistence` says."""
        if observation.stamp < self._last - 1.0:  # time went back
            self._kept.clear()
        self._last = observation.stamp
        self._kept.append(observation)
        oldest = observation.stamp - self.params.observation_persistence
        self._kept = [o for o in self._kept if o.stamp >= oldest]
        if self.params.observation_persistence == 0.0:
            self._kept = self._kept[-1:]

    def all(self) -> list[Observation]:
        """Observations for an update, oldest first; none if the points' height is outside the source's limits."""
        lowest, highest = self.params.min_obstacle_height, self.params.max_obstacle_height
        return [o for o in self._kept if lowest - _HAIR <= o.height <= highest + _HAIR]

    def clear(self) -> None:
        """Forget all, so that an old scan does not restore what was cleared."""
        self._kept.clear()

    def is_current(self, now: float) -> bool:
        """Whether input is as fresh as `expected_update_rate` demands."""
        limit = self.params.expected_update_rate
        return limit == 0.0 or now - self._last <= limit
