"""slam_gmapping without ROS: odometry and scans in, pose and map out.

A Rao-Blackwellised particle filter with improved proposals and adaptive resampling (Grisetti, Stachniss, Burgard 2007).
The decisions are upstream's. An update runs after the robot has driven `linearUpdate` or turned `angularUpdate` in all,
or after `temporalUpdate`. Particles are resampled when their effective share is less than `resampleThreshold`. The
published map is that of the particle whose ancestry has the highest likelihood.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, angle_difference, compose, compose_poses, invert, wrap_angle
from rosbot_patrol.gmapping.beams import Beams, pick_beams
from rosbot_patrol.gmapping.motion_model import move_deviation, move_poses
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.gmapping.scan_matcher import ScanMatcher
from rosbot_patrol.gmapping.trajectories import Trajectories
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan import LaserScan

if TYPE_CHECKING:
    from rosbot_patrol.gmapping.back_end.loop_closer import LoopCloser

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

JUMP_M, JUMP_SPEED = 1.0, 5.0  # odometry that moves farther than this and faster is a restart, not a motion
STEP_S = 1.0  # what a step between scans of the same stamp counts, as in logs without times
RESTART_S = 1.0  # time that goes back by more than this is a restart; by less, scans came out of order


@dataclass(frozen=True)
class Outcome:
    """Result of one scan.

    Attributes:
        updated: the maps were written.
        resampled: the particles were resampled.
        failed: number of particles that followed the odometry after a failed match.
        is_blind: the robot moved, but no beam of the scan is usable.
        effective: effective number of particles at this update.
        fit: share of the scan's beams that lie on walls of the best particle's map, before the scan is written into it.
    """

    updated: bool = False
    resampled: bool = False
    failed: int = 0
    is_blind: bool = False
    effective: float = 0.0
    fit: float = 1.0


class Slam:
    """Maps the surroundings of one robot.

    Args:
        params: of slam_gmapping.
        saved: a map to extend, None: an empty one.
        start: pose of the robot on it; None: the odometry's.

    Raises:
        MapError: the extent or the saved map is invalid.
    """

    def __init__(self, params: GmappingParams, *, saved: Grid | None = None, start: Pose2D | None = None) -> None:
        self._params = params
        self._rng = np.random.default_rng(params.seed)
        p = params
        self.maps = ParticleMaps((p.xmin, p.ymin), (p.xmax, p.ymax), p.delta, p.particles)
        if saved is not None:
            self.maps.seed(saved)
        self._saved = saved
        self._closer = loop_closer(params)
        self._start = start
        self._matcher = ScanMatcher(params)
        self._trajectories = Trajectories()
        self.poses: Array = np.empty((0, 3))
        self._log_weights = np.zeros(p.particles)  # since the last resampling
        self._totals = np.zeros(p.particles)  # of the whole ancestry
        self._odometry: Pose2D | None = None  # at the last scan
        self._updated_at = Pose2D()  # odometry at the last update
        self._way = self._turn = 0.0
        self._stamp = self._updated_stamp = -math.inf
        self.stamps: list[float] = []  # of the updates
        self.map_from_odom: Pose2D | None = None

    @property
    def best(self) -> int:
        """Index of the particle whose ancestry has the highest likelihood."""
        return int(np.argmax(self._totals))

    @property
    def weights(self) -> Array:
        """Weights of the particles, with sum 1, shape (N,)."""
        gain = 1.0 / (self._params.ogain * self._params.particles)
        weights = np.exp(gain * (self._log_weights - self._log_weights.max()))
        return np.asarray(weights / weights.sum())

    @property
    def entropy(self) -> float:
        """Entropy of the particle weights: 0 if one particle has all the weight, log(N) if all are equal."""
        weights = self.weights
        return float(-np.sum(weights * np.log(np.maximum(weights, 1e-300))))

    @property
    def trajectory(self) -> Array:
        """Poses of the best particle at each update, shape (U, 3)."""
        return self._trajectories.of(self.best)

    def grid(self) -> Grid:
        """The best particle's map, int8 cells (-1 unknown, 0 free, 100 occupied)."""
        return self.maps.grid(self.best, self._params.occ_thresh)

    def update(self, scan: LaserScan, odom_from_base: Pose2D, base_from_laser: Pose2D) -> Outcome:
        """Add a scan and the odometry at its time.

        Args:
            scan: a level scan.
            odom_from_base: the robot in the odometry's frame at the scan's stamp.
            base_from_laser: of the level scan.
        """
        if self._odometry is None:
            return self._begin(scan.stamp, odom_from_base, pick_beams(scan, base_from_laser, self._params))
        self._check_restart(scan.stamp, odom_from_base)
        self._way += math.hypot(odom_from_base.x - self._odometry.x, odom_from_base.y - self._odometry.y)
        self._turn += abs(angle_difference(odom_from_base.yaw, self._odometry.yaw))
        self._odometry, self._stamp = odom_from_base, scan.stamp
        if not self._is_due():
            return Outcome()
        move = compose(invert(self._updated_at), odom_from_base)
        outcome = self._step(move, pick_beams(scan, base_from_laser, self._params))
        self._note(scan.stamp, odom_from_base)
        return outcome

    def _begin(self, stamp: float, odometry: Pose2D, beams: Beams) -> Outcome:
        if not beams.is_hit.any():
            return Outcome(is_blind=True)
        first = odometry if self._start is None else self._start
        self.poses = np.tile(np.array(first, dtype=np.float64), (self._params.particles, 1))
        self._odometry = self._updated_at = odometry
        if self._saved is not None:
            return self._resume(stamp, odometry, beams)
        self.maps.register(self.poses, beams)
        self._trajectories.add(self.poses, np.arange(len(self.poses)))
        self._close_loops(beams)
        self._note(stamp, odometry)
        return Outcome(updated=True, effective=float(len(self.poses)))

    def _resume(self, stamp: float, odometry: Pose2D, beams: Beams) -> Outcome:
        """Match the first scan on a saved map, from anywhere near the start."""
        outcome = self._step(Pose2D(), beams, deviation=np.array([0.25, 0.25, 0.25]))
        self._note(stamp, odometry)
        return outcome

    def _is_due(self) -> bool:
        p = self._params
        elapsed = self._stamp - self._updated_stamp
        return (
            self._way >= p.linearUpdate
            or self._turn >= p.angularUpdate
            or (p.temporalUpdate >= 0.0 and elapsed > p.temporalUpdate)
        )

    def _step(self, move: Pose2D, beams: Beams, deviation: Array | None = None) -> Outcome:
        """Move, match, weigh, resample, write."""
        sigmas = move_deviation(move, self._params) if deviation is None else deviation
        noise = self._rng.standard_normal((len(self.poses), 3))
        guesses, headings = move_poses(self.poses, move), self.poses[:, 2]
        if not beams.is_hit.any():
            self.poses = move_poses(guesses, Pose2D())
            self.poses += _in_map(noise * sigmas, headings)
            self._trajectories.add(self.poses, np.arange(len(self.poses)))
            self._close_loops(beams)
            return Outcome(updated=True, is_blind=True)
        best = self.best
        found = self._matcher.match(self.maps, guesses, headings, beams, sigmas, best=best, noise=noise)
        fit = float(found.scores[best]) / np.count_nonzero(beams.is_hit)
        self.poses = found.poses
        self._log_weights += found.log_likelihoods
        self._totals += found.log_likelihoods
        parents, effective = self._resample_when_due()
        self.maps.register(self.poses, beams)
        self._trajectories.add(self.poses, parents)
        self._close_loops(beams)
        failed = int(np.count_nonzero(found.scores <= self._params.minimumScore))
        resampled = effective < self._params.resampleThreshold * len(self.poses)
        return Outcome(updated=True, resampled=resampled, failed=failed, effective=effective, fit=fit)

    def _close_loops(self, beams: Beams) -> None:
        """Correct all poses if the last scan closes a loop, and draw one map for all particles."""
        if self._closer is None:
            return
        before = self.trajectory
        after = self._closer.add(before, beams)
        if after is None:
            return
        self.poses = compose_poses(compose(Pose2D(*after[-1]), invert(Pose2D(*before[-1]))), self.poses)
        self.maps.draw_anew(after, self._closer.scans, self._saved)
        self._trajectories.restart(after[:-1], self.poses)

    def _resample_when_due(self) -> tuple[NDArray[np.int64], float]:
        """Index of each particle's parent, and the effective number of particles."""
        weights = self.weights
        count = len(weights)
        effective = float(1.0 / np.sum(weights**2))
        parents = np.arange(count)
        if effective < self._params.resampleThreshold * count:
            steps = (np.arange(count) + self._rng.random()) / count
            parents = np.minimum(np.searchsorted(np.cumsum(weights), steps), count - 1)
            self.poses = self.poses[parents]
            self._totals = self._totals[parents]
            self._log_weights = np.zeros(count)
            self.maps.select(parents)
        return parents, effective

    def _note(self, stamp: float, odometry: Pose2D) -> None:
        """Record an update."""
        self._updated_at, self._updated_stamp, self._stamp = odometry, stamp, stamp
        self._way = self._turn = 0.0
        self.stamps.append(stamp)
        self._correct()

    def _correct(self) -> None:
        x, y, yaw = self.poses[self.best].tolist()
        self.map_from_odom = compose(Pose2D(x, y, wrap_angle(yaw)), invert(self._updated_at))

    def _check_restart(self, stamp: float, odometry: Pose2D) -> None:
        """After a jump of time or odometry, continue without applying the jump."""
        assert self._odometry is not None
        elapsed = stamp - self._stamp
        way = math.hypot(odometry.x - self._odometry.x, odometry.y - self._odometry.y)
        if elapsed < -RESTART_S:
            log.warning("time went back by %.3f s: going on from the last pose", -elapsed)
        elif way > JUMP_M + JUMP_SPEED * (abs(elapsed) or STEP_S):
            log.warning("the odometry jumped by %.2f m in %.2f s: taken as its restart, not as a motion", way, elapsed)
        else:
            return
        last = compose(invert(self._updated_at), self._odometry)  # moved since the last update
        self._odometry = odometry
        self._updated_at = compose(odometry, invert(last))
        self._updated_stamp = stamp
        self._correct()


def loop_closer(params: GmappingParams) -> LoopCloser | None:
    """The back end if it is wanted; only then it is loaded, because its solver needs memory."""
    if not params.loop_closure:
        return None
    from rosbot_patrol.gmapping.back_end.loop_closer import LoopCloser

    return LoopCloser(params.delta)


def _in_map(errors: Array, headings: Array) -> Array:
    """Rotate errors ahead, to the left and in turning to the map's axes, shape (N, 3)."""
    c, s = np.cos(headings), np.sin(headings)
    return np.column_stack((c * errors[:, 0] - s * errors[:, 1], s * errors[:, 0] + c * errors[:, 1], errors[:, 2]))
