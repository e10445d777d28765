"""Scans as the obstacle layer uses them, and the buffer that says which of them still count."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.params import SourceParams
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.scan import LaserScan, LevelScan

Array = NDArray[np.float64]

_EPSILON = 1e-4  # upstream's step back from range_max for a beam that hit nothing [m]
_HAIR = 1e-6  # of heights: rounding of a transform [m]


@dataclass(frozen=True)
class View:
    """How far a scan saw along each beam.

    Attributes:
        start: bearing of the first beam in the costmap's frame [rad].
        increment: from beam to beam [rad].
        clear: nothing stands nearer than this [m], inf where the beam hit nothing, 0 where nothing is known; (N,).
    """

    start: float
    increment: float
    clear: Array

    def free_to(self, bearings: Array) -> Array:
        """How far it is surely free in the directions of `bearings` [rad]: the shorter of the two beams beside."""
        if len(self.clear) == 0 or self.increment == 0.0:
            return np.zeros(len(bearings))
        period = math.tau / abs(self.increment)
        at = np.mod((bearings - self.start) / self.increment, period)
        first = np.floor(at).astype(np.int64)
        second = first + 1
        count = len(self.clear)
        if count >= period - 1.5:  # all around
            return np.minimum(self.clear[first % count], self.clear[second % count])
        known = second < count
        return np.where(known, np.minimum(self.clear[first % count], self.clear[second % count]), 0.0)


@dataclass(frozen=True, kw_only=True)
class Observation:
    """A scan in the costmap's frame.

    Attributes:
        stamp: when it was measured [s].
        sensor: where from, (x, y) [m].
        hits: what was hit, shape (N, 2).
        ends: up to where the way is free, shape (M, 2).
        height: of the points above the ground [m].
        view: how far each beam saw, None where that is not known.
    """

    stamp: float
    sensor: tuple[float, float]
    hits: Array
    ends: Array
    height: float = 0.1
    view: View | None = None


def observe(scan: LaserScan, pose: Pose2D, *, inf_is_valid: bool = False, height: float = 0.1) -> Observation:
    """A level scan taken at `pose` (of the sensor, in the costmap's frame) as an observation.

    Beams outside the scan's own limits, range_max included, say nothing, as in laser_geometry; with `inf_is_valid` a
    beam that hit nothing clears up to the range's end, or for 100 m where the scan has no upper limit.

    Differs: upstream makes such a beam's end an obstacle where obstacle_range reaches that far; here it never marks.
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
    """A scan that was laid level in the costmap's frame as an observation.

    Points of a tilted laser have heights of their own: those outside the source's limits neither mark nor clear, as in
    costmap_2d::ObservationBuffer.

    Args:
        level: the scan.
        source: its limits.
        top: the layer's `max_obstacle_height` [m]: what is higher clears, and is not marked.
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
    """Why a source takes nothing of a scan, "" where it does: upstream's then marks and clears nothing, in silence."""
    low, high = source.min_obstacle_height, source.max_obstacle_height
    if level.rises is not None or low - _HAIR <= level.height <= high + _HAIR:
        return ""
    return (
        f"the laser '{level.scan.frame_id}' is {level.height:.2f} m high in the costmap's frame, outside"
        f" min_obstacle_height {low:g} to max_obstacle_height {high:g}: its scan would mark and clear nothing"
    )


class ObservationBuffer:
    """The observations of one source that are still to be used."""

    def __init__(self, params: SourceParams) -> None:
        self.params = params
        self._kept: list[Observation] = []
        self._last = float("-inf")

    def add(self, observation: Observation) -> None:
        """Store one; older ones go as `observation_persistence` says."""
        if observation.stamp < self._last - 1.0:  # time went back
            self._kept.clear()
        self._last = observation.stamp
        self._kept.append(observation)
        oldest = observation.stamp - self.params.observation_persistence
        self._kept = [o for o in self._kept if o.stamp >= oldest]
        if self.params.observation_persistence == 0.0:
            self._kept = self._kept[-1:]

    def all(self) -> list[Observation]:
        """What an update uses, oldest first; none where the points' height is outside the source's limits."""
        lowest, highest = self.params.min_obstacle_height, self.params.max_obstacle_height
        return [o for o in self._kept if lowest - _HAIR <= o.height <= highest + _HAIR]

    def clear(self) -> None:
        """Forget all, so that what was cleared does not come back from an old scan."""
        self._kept.clear()

    def is_current(self, now: float) -> bool:
        """Whether input is as fresh as `expected_update_rate` demands."""
        limit = self.params.expected_update_rate
        return limit == 0.0 or now - self._last <= limit
