"""Particle filter over the robot's pose (Probabilistic Robotics, tables 8.2 and 8.3)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.particles import resample_kernels as kernels
from rosbot_patrol.amcl.particles.kld import KldRule
from rosbot_patrol.amcl.scan_model.sensor_model import Weighing
from rosbot_patrol.geometry import Pose2D, wrap_angles

Array = NDArray[np.float64]
RandomPoses = Callable[[int], Array]

CORE_SHARE = 0.1  # share of the heaviest bin's weight: lighter bins do not link clusters


@dataclass(frozen=True)
class Estimate:
    """Best estimate of the pose.

    Attributes:
        pose: mean of the heaviest cluster of particles.
        covariance: of all particles, x, y, yaw, shape (3, 3).
        cluster_weight: share of the weight in that cluster, 0 to 1.
        cluster_spread: standard deviation of the position within it [m].
        particles: how many there are.
    """

    pose: Pose2D
    covariance: Array
    cluster_weight: float
    cluster_spread: float
    particles: int


class ParticleFilter:
    """Weighted pose particles.

    Args:
        rule: number of particles.
        alpha_slow, alpha_fast: decay of the averages of the fit; if the fast one falls below the slow one, random
            poses are mixed in. 0 turns that off.
        rng: source of random numbers.
    """

    def __init__(self, rule: KldRule, *, alpha_slow: float, alpha_fast: float, rng: np.random.Generator) -> None:
        self._rule = rule
        self._alpha_slow, self._alpha_fast = alpha_slow, alpha_fast
        self._slow = self._fast = 0.0
        self._rng = rng
        self.poses: Array = np.zeros((1, 3))
        self.weights: Array = np.ones(1)
        self._evidence: Array = np.zeros(1)

    def configure(self, rule: KldRule, *, alpha_slow: float, alpha_fast: float) -> None:
        """Use other rules from now on; the particles stay."""
        self._rule = rule
        self._alpha_slow, self._alpha_fast = alpha_slow, alpha_fast

    def spread_about(self, pose: Pose2D, covariance: Array) -> None:
        """Restart from a Gaussian around a pose; covariance of x, y, yaw, shape (3, 3), symmetrised and clipped."""
        values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
        scaled = self._rng.standard_normal((self._rule.most, 3)) * np.sqrt(np.maximum(values, 0.0))
        self.set_particles(np.array(pose) + scaled @ vectors.T)

    def spread_over(self, random_poses: RandomPoses) -> None:
        """Restart with poses anywhere."""
        self.set_particles(random_poses(self._rule.most))

    def set_particles(self, poses: Array) -> None:
        """Restart from given poses, shape (N, 3), with equal weights."""
        poses[:, 2] = wrap_angles(poses[:, 2])
        self.poses = np.ascontiguousarray(poses)
        self._level()
        self._slow = self._fast = 0.0

    def _level(self) -> None:
        self._evidence = np.zeros(len(self.poses))
        self.weights = np.full(len(self.poses), 1.0 / len(self.poses))

    def weigh(self, weighing: Weighing) -> None:
        """Weigh the particles by a scan."""
        fit = float((self.weights * weighing.fit).sum())
        weights = self.weights * weighing.likelihood
        total = weights.sum()
        if total > 0.0 and math.isfinite(total):
            self.weights = weights / total
        else:
            self._level()
        self._evidence = weighing.evidence
        self._slow = fit if self._slow == 0.0 else self._slow + self._alpha_slow * (fit - self._slow)
        self._fast = fit if self._fast == 0.0 else self._fast + self._alpha_fast * (fit - self._fast)

    @property
    def effective_share(self) -> float:
        """Effective share of the particles, 0 to 1."""
        return float(1.0 / (np.square(self.weights).sum() * len(self.weights)))

    @property
    def stranger_share(self) -> float:
        """Share of random poses in the next resampling."""
        if self._alpha_slow <= 0.0 or self._alpha_fast <= 0.0 or self._slow <= 0.0:
            return 0.0
        return max(0.0, 1.0 - self._fast / self._slow)

    def resample(self, random_poses: RandomPoses) -> None:
        """Resample the particles, with as many as their spread requires."""
        strangers = self._strangers(random_poses)
        drawn = np.empty((self._rule.most, 3))
        cumulative = np.cumsum(self.weights)
        cumulative /= cumulative[-1]
        rule = self._rule
        count = kernels.draw(
            self.poses,
            cumulative,
            float(self._rng.random()),
            strangers,
            rule.error,
            rule.z,
            rule.least,
            rule.most,
            drawn,
        )
        self.poses = drawn[:count].copy()
        self._level()

    def _strangers(self, random_poses: RandomPoses) -> Array:
        share = self.stranger_share
        if share <= 0.0:
            return np.empty((0, 3))
        self._slow = self._fast = 0.0  # else random poses would cause more random poses
        strangers = random_poses(self._rule.most)
        strangers[self._rng.random(len(strangers)) >= share] = np.nan
        return strangers

    def estimate(self) -> Estimate:
        """Mean of the heaviest cluster and covariance of all particles.

        Within the cluster, particles are weighted by their fit to the newest scan. The weights of upstream's sensor
        model are so soft that their plain mean is half a metre off when updates are rare.
        """
        labels = np.empty(len(self.poses), dtype=np.int64)
        numbers = kernels.label_clusters(self.poses, self.weights, CORE_SHARE, labels)
        weight_of = np.bincount(labels, weights=self.weights, minlength=numbers)
        chosen = int(weight_of.argmax())
        top = self._evidence[labels == chosen].max()
        sharp = self.weights * np.exp(np.minimum(self._evidence - top, 0.0))
        best = kernels.moments(self.poses, sharp, labels, chosen)
        whole = kernels.moments(self.poses, self.weights, labels, -1)
        cluster = kernels.moments(self.poses, self.weights, labels, chosen)
        return Estimate(
            pose=Pose2D(*best[0].tolist()),
            covariance=whole[1:4].copy(),
            cluster_weight=float(weight_of[chosen]),
            cluster_spread=math.sqrt(max(float(cluster[1, 0] + cluster[2, 1]), 0.0)),
            particles=len(self.poses),
        )
