"""Scans as the obstacle layer uses them, and the buffer that says which of them still count."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.params import SourceParams
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

_EPSILON = 1e-4  # upstream's step back from range_max for a beam that hit nothing [m]


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
    """A scan taken at `pose` (of the sensor, in the costmap's frame; no flip) as an observation.

    Beams outside the scan's own limits, range_max included, say nothing, as in laser_geometry; with `inf_is_valid` a
    beam that hit nothing clears up to the range's end.

    Differs: upstream makes such a beam's end an obstacle where obstacle_range reaches that far; here it never marks.
    """
    angles = scan.angles
    units = np.column_stack((np.cos(angles), np.sin(angles)))
    hit = scan.is_hit & (scan.ranges < scan.range_max)
    hits = transform_points(pose, units[hit] * scan.ranges[hit, None])
    ends = hits
    is_open = np.isposinf(scan.ranges)
    if inf_is_valid:
        far = transform_points(pose, units[is_open] * (scan.range_max - _EPSILON))
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
        return [o for o in self._kept if lowest <= o.height <= highest]

    def clear(self) -> None:
        """Forget all, so that what was cleared does not come back from an old scan."""
        self._kept.clear()

    def is_current(self, now: float) -> bool:
        """Whether input is as fresh as `expected_update_rate` demands."""
        limit = self.params.expected_update_rate
        return limit == 0.0 or now - self._last <= limit
