"""Loops: where the robot is at a place that it has seen before, and the poses that fit all such relations.

Each `KEY_M` the last scans together are searched in a small map of what was seen near there on an earlier way. Such a
match is a relation from one pose to another (Hess, Kohler, Rapp, Andor: Real-time loop closure in 2D LIDAR SLAM, 2016).
The front end's steps and these relations make a graph of poses (`pose_graph`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.gmapping.back_end.kept_scans import KeptScans
from rosbot_patrol.gmapping.back_end.pose_graph import (
    INLIER,
    Relations,
    errors_of,
    relative_moves,
    solve,
    squared_lengths,
)
from rosbot_patrol.gmapping.back_end.visit import Visit
from rosbot_patrol.gmapping.beams import Beams

Array = NDArray[np.float64]

KEY_M, KEY_TURN = 0.5, 0.5  # way [m] or turn [rad] from search to search
APART = 12.0  # way between two visits of a place [m]
NEAR = 2.5  # how near an earlier pose must be, besides the drift [m]
AROUND = 4.0  # way before and after an earlier pose that makes its small map [m]
BEHIND = 2.0  # way of the last scans that are searched together [m]
VISITS = 2  # earlier visits that are tried at each place
DRIFT, DRIFT_TURN = 0.08, 0.015  # by which a pose may be off after each metre without a loop [m, rad] ...
REACH, REACH_TURN = (0.5, 5.0), (0.12, 0.6)  # ... from and up to these [m, rad]
MAP_ERROR = (0.03, 0.03, 0.008)  # of a search: of the small map, and of scans that several searches share [m, m, rad]
STEP_ERROR = (0.003, 0.003, 0.001)  # of the front end from update to update [m, m, rad] ...
WAY_ERROR = (0.02, 0.02, 0.005)  # ... and on a metre, likewise
SUPPORT, NEARBY = 3, 3.0  # relations between two visits, within this way [m], that it takes to believe one of them
EXPECTED = 3.0  # squared Mahalanobis length up to which a loop says what the poses say already
SHIFT, SHIFT_TURN = 0.06, 0.02  # by so much less a relation is off where a new map is worth it [m, rad] ...
PAUSE, SHARE = 5.0, 0.05  # ... after this way [m] or share of the whole way, because a long one takes long to draw
AT_ONCE = 10.0  # changes so many times as large are worth it at once


class LoopCloser:
    """Finds loops and corrects the poses.

    Args:
        resolution: of the maps [m].

    Attributes:
        scans: of all updates.
        loops: relations found so far.
    """

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.scans = KeptScans()
        self.loops = Relations.none()
        self._steps = np.empty((0, 3))  # of the front end, measured before the last correction
        self._searched = 0  # update of the last search
        self._closed = 0  # update of the last loop that agrees with the others
        self._solved_at = 0.0  # way at the last solution [m]
        self._corrected_at = 0.0  # way at the last correction [m]

    def add(self, poses: Array, beams: Beams) -> Array | None:
        """Take in an update.

        Args:
            poses: of the updates so far, as corrected before, shape (U, 3).
            beams: of the last one.

        Returns:
            Better poses, shape (U, 3); None if these are good.
        """
        self.scans.add(beams)
        last = len(poses) - 1
        ways = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))
        turned = float(np.abs(np.diff(poses[self._searched :, 2])).sum())
        if ways[last] - ways[self._searched] < KEY_M and turned < KEY_TURN:
            return None
        self._searched = last
        found = self._search(poses, ways)
        if not len(found.first):
            return None
        self.loops = self.loops.joined(found)
        lengths = squared_lengths(errors_of(poses, found), found.information)
        if lengths.min() < INLIER:
            self._closed = last
        if lengths.max() < EXPECTED and ways[last] - self._solved_at < _pause(ways):
            return None
        return self._correct(poses, ways)

    def _correct(self, poses: Array, ways: Array) -> Array | None:
        """Solve the graph; returns the poses if the changes are worth it."""
        loops = self._supported(ways)
        index = np.arange(len(poses) - 1)
        steps = relative_moves(poses, index, index + 1)
        steps[: len(self._steps)] = self._steps
        squares = np.square(STEP_ERROR) + np.square(WAY_ERROR) * np.hypot(steps[:, 0], steps[:, 1])[:, None]
        chain = Relations(index, index + 1, steps, np.einsum("ri,ij->rij", 1.0 / squares, np.eye(3)))
        found = solve(poses, chain, loops)
        self._solved_at = float(ways[-1])
        is_believed = found.weights > 0.5
        if is_believed[loops.second == len(poses) - 1].any():
            self._closed = len(poses) - 1
        off = [np.abs(errors_of(each, loops)[is_believed]) for each in (poses, found.poses)]
        gains = np.hypot(*off[0][:, :2].T) - np.hypot(*off[1][:, :2].T), off[0][:, 2] - off[1][:, 2]
        amount = max(gains[0].max(initial=0.0) / SHIFT, gains[1].max(initial=0.0) / SHIFT_TURN)
        if amount < 1.0 or (amount < AT_ONCE and ways[-1] - self._corrected_at < _pause(ways)):
            return None
        self._corrected_at = float(ways[-1])
        self._steps = steps
        return aligned(found.poses, poses)

    def _supported(self, ways: Array) -> Relations:
        """The relations that are not alone: a wrong one hardly ever comes thrice between two visits."""
        first, second = ways[self.loops.first], ways[self.loops.second]
        near = (np.abs(first - first[:, None]) <= AROUND) & (np.abs(second - second[:, None]) <= NEARBY)
        supported = near.sum(axis=1) >= SUPPORT
        return Relations(*(values[supported] for values in self.loops))

    def _search(self, poses: Array, ways: Array) -> Relations:
        """Look for the last pose on earlier ways."""
        found = Relations.none()
        alone = ways[-1] - ways[self._closed]
        reach = float(np.clip(DRIFT * alone, *REACH))
        turn = float(np.clip(DRIFT_TURN * alone, *REACH_TURN))
        anchors = self._anchors(poses, ways, NEAR + reach)
        last = self._visit(poses, ways, len(poses) - 1, BEHIND)
        for anchor in anchors:
            earlier = self._visit(poses, ways, anchor, AROUND)
            guess = relative_moves(poses, np.array([anchor]), np.array([len(poses) - 1]))[0]
            place = earlier.find(last, Pose2D(*guess), reach, turn)
            if place is not None:
                pair = np.array([anchor]), np.array([len(poses) - 1])
                covariance = place.covariance + np.diag(np.square(MAP_ERROR))
                relation = Relations(*pair, np.array([place.pose]), np.linalg.inv(covariance)[None])
                found = found.joined(relation)
        return found

    def _anchors(self, poses: Array, ways: Array, radius: float) -> list[int]:
        """Updates of earlier visits that were nearest to the last pose, one for each visit, the nearest first."""
        gaps = np.hypot(*(poses[:, :2] - poses[-1, :2]).T)
        near = np.flatnonzero((gaps < radius) & (ways < ways[-1] - APART))
        if len(near) == 0:
            return []
        visits = np.split(near, np.flatnonzero(np.diff(ways[near]) > AROUND) + 1)
        nearest = [int(visit[np.argmin(gaps[visit])]) for visit in visits]
        return sorted(nearest, key=lambda index: float(gaps[index]))[:VISITS]

    def _visit(self, poses: Array, ways: Array, anchor: int, around: float) -> Visit:
        """What was seen up to `around` metres of way before and after an update."""
        first = int(np.searchsorted(ways, ways[anchor] - around))
        end = int(np.searchsorted(ways, ways[anchor] + around, side="right"))
        return Visit(self.scans, poses, range(first, end), anchor, self._resolution)


def _pause(ways: Array) -> float:
    """Way from correction to correction [m]."""
    return max(PAUSE, SHARE * float(ways[-1]))


def aligned(poses: Array, others: Array) -> Array:
    """Poses moved as a whole so that their places lie as near to the others as possible, shape (N, 3).

    Least squares (Umeyama: Least-squares estimation of transformation parameters between two point patterns, 1991).
    """
    centre, other = poses[:, :2].mean(axis=0), others[:, :2].mean(axis=0)
    a, b = poses[:, :2] - centre, others[:, :2] - other
    turn = math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
    out = np.empty_like(poses)
    out[:, :2] = transform_points(Pose2D(0.0, 0.0, turn), a) + other
    out[:, 2] = poses[:, 2] + turn
    return out
