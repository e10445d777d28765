"""Search for a lost robot: a second filter over the whole map, beside the active one.

The active filter is left alone during the search, so that the pose does not jump about the house; the result is handed
over once. The search starts with poses that one scan supports. It weighs them more sharply than amcl does, and adds new
ones from every scan, in case the right one was missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.particles.kld import KldRule
from rosbot_patrol.amcl.particles.particle_filter import Estimate, ParticleFilter
from rosbot_patrol.amcl.scan_model.floor import Floor
from rosbot_patrol.amcl.scan_model.likelihood_field import Field
from rosbot_patrol.amcl.scan_model.sensor_model import Beams, SensorModel, Weighing
from rosbot_patrol.amcl.trust import agreement
from rosbot_patrol.geometry import Pose2D, angle_difference, wrap_angles

Array = NDArray[np.float64]
Move = Callable[[Array, Pose2D, Pose2D], None]

LEAST, MOST = 500, 3000  # particles
TRIED_PER_M2, MOST_TRIED = 600.0, 400_000  # random poses from which the first particles are picked
FRESH_TRIED, FRESH_SHARE = 5000, 0.1  # the same for later scans, and their share in each resampling
SHARPNESS = 10.0  # weight of a particle's fit
STEP_M, STEP_RAD = 0.1, 0.15  # of motion between updates, however seldom amcl updates
FOUND_AGREEMENT, FOUND_CLUSTER = 0.7, 0.8
FOUND_UPDATES = 6  # consecutive updates for which a place must hold
KEEPS = 0.5  # weight of the previous average of the agreement in an update
NEAR_M, NEAR_RAD = 0.5, 0.4  # extent of the place that was found


class Seeker:
    """One search.

    Args:
        model: weighs poses.
        wide: a more tolerant one, for the random poses.
        obstacles: distance to the nearest obstacle [m], for the verdict.
        floor: the free floor.
        rng: source of random numbers.
    """

    def __init__(
        self, model: SensorModel, wide: SensorModel, obstacles: Field, floor: Floor, rng: np.random.Generator
    ) -> None:
        self._model, self._wide = model, wide
        self._obstacles, self._floor = obstacles, floor
        self.filter = ParticleFilter(KldRule(least=LEAST, most=MOST), alpha_slow=0.0, alpha_fast=0.0, rng=rng)
        self._rng = rng
        self._odometry: Pose2D | None = None  # at the last update
        self._held = 0
        self._agreement = math.nan
        self.estimate: Estimate | None = None

    def update(self, beams: Beams, odometry: Pose2D, move: Move) -> bool:
        """Process a scan if the robot has moved enough; returns whether it has.

        Args:
            beams: of the scan.
            odometry: odom_from_base at its time.
            move: moves particles as the odometry moved between two poses.
        """
        if self._odometry is None:
            tried = int(min(max(TRIED_PER_M2 * self._floor.area, MOST), MOST_TRIED))
            self.filter.set_particles(self._floor.likely_poses(self._wide, beams, tried=tried, count=MOST))
        elif not _has_moved(self._odometry, odometry):
            return False
        else:
            move(self.filter.poses, self._odometry, odometry)
        self._odometry = odometry
        self._weigh(beams)
        return True

    def restart(self, last: Pose2D, odometry: Pose2D, move: Move) -> None:
        """Continue after the odometry has restarted at a pose."""
        if self._odometry is not None:
            move(self.filter.poses, self._odometry, last)
            self._odometry = odometry

    def _weigh(self, beams: Beams) -> None:
        weighing = self._model.weigh(self.filter.poses, beams)
        if weighing is None:
            return
        sharp = np.exp(SHARPNESS * (weighing.fit - weighing.fit.max()))
        self.filter.weigh(Weighing(sharp, weighing.fit, weighing.evidence))
        self.estimate = self.filter.estimate()
        self._update_agreement(self.estimate, beams)
        self.filter.resample(self._floor.random_poses)
        self._freshen(beams)

    def _update_agreement(self, estimate: Estimate, beams: Beams) -> None:
        found = agreement(estimate.pose, beams, self._obstacles)
        if found is None:
            return
        is_first = math.isnan(self._agreement)
        self._agreement = found if is_first else KEEPS * self._agreement + (1.0 - KEEPS) * found
        is_good = self._agreement >= FOUND_AGREEMENT and estimate.cluster_weight >= FOUND_CLUSTER
        self._held = self._held + 1 if is_good else 0

    def _freshen(self, beams: Beams) -> None:
        """Replace some particles by new poses."""
        poses = self.filter.poses
        count = int(FRESH_SHARE * len(poses))
        if count:
            places = self._rng.choice(len(poses), count, replace=False)
            poses[places] = self._floor.likely_poses(self._wide, beams, tried=FRESH_TRIED, count=count)

    def found(self, believed: float) -> Estimate | None:
        """Pose of the robot when it is clear, else None.

        Args:
            believed: agreement at the active estimate, 0 to 1, nan if unknown; the new one must exceed it.
        """
        if self.estimate is None or self._held < FOUND_UPDATES:
            return None
        if not math.isnan(believed) and self._agreement < believed + 0.1:
            return None
        return self.estimate

    def near(self, pose: Pose2D) -> Array:
        """Particles around a pose, shape (N, 3)."""
        poses = self.filter.poses
        off = np.hypot(poses[:, 0] - pose.x, poses[:, 1] - pose.y)
        turn = np.abs(wrap_angles(poses[:, 2] - pose.yaw))
        chosen = poses[(off < NEAR_M) & (turn < NEAR_RAD)]
        return chosen.copy() if len(chosen) else np.array([pose], dtype=np.float64)


def _has_moved(start: Pose2D, end: Pose2D) -> bool:
    return math.hypot(end.x - start.x, end.y - start.y) > STEP_M or abs(angle_difference(end.yaw, start.yaw)) > STEP_RAD
