"""Sensor models: fit of a scan to a map, seen from many poses (Probabilistic Robotics, chapter 6).

`likelihood_field` and `beam` add the cubed probabilities of the beams, as upstream does. The sum is softer than their
product and tolerates obstacles that are not on the map. It is too soft when updates are rare: with the tutorial's
parameters a person who filled 30 % of the view led it astray by metres, in each of four drives. Therefore the sum
counts to the third power. That is still far softer than a product, and none of the four drives was off by more than 0.2
m. `likelihood_field_prob` multiplies the probabilities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.scan_model import field_kernels as kernels
from rosbot_patrol.amcl.scan_model.likelihood_field import Field, blocked_distances, obstacle_distances
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

CONVERGED_M = 0.5  # upstream's


@dataclass(frozen=True)
class Beams:
    """Usable beams of a scan.

    Attributes:
        xs, ys: end points of those that hit, in the robot's frame [m], shapes (K,).
        mount: pose of the sensor on the robot.
        angles, ranges: all beams in the sensor's frame [rad, m], `reach` without a hit, shapes (L,).
        reach: largest range [m].
        frame: of the laser.
    """

    xs: Array
    ys: Array
    mount: Pose2D
    angles: Array
    ranges: Array
    reach: float
    frame: str = ""


@dataclass(frozen=True)
class Weighing:
    """Weights of particles from a scan.

    Attributes:
        likelihood: factors of their weights, shape (N,).
        fit: how well each agrees, 0 to 1, shape (N,).
        evidence: logarithm of a sharper likelihood, by which the pose is picked among them, shape (N,).
    """

    likelihood: Array
    fit: Array
    evidence: Array


class SensorModel(Protocol):
    """Weighs poses by a scan."""

    def weigh(self, poses: Array, beams: Beams) -> Weighing | None:
        """Likelihood and fit of each pose, shape (N, 3); None if the scan is empty."""


def pick_beams(scan: LaserScan, base_from_laser: Pose2D, params: AmclParams) -> Beams:
    """Select evenly spread beams of a level scan, as many as the parameters ask for.

    Readings at or below the least range count as misses; NaN and readings beyond the largest range are no hits.
    """
    count = len(scan.ranges)
    step = max((count - 1) // (params.laser_max_beams - 1), 1)
    picked = np.arange(0, count, step)
    ranges = scan.ranges[picked]
    reach = min(scan.reach, params.laser_max_range) if params.laser_max_range > 0.0 else scan.reach
    least = max(scan.range_min, params.laser_min_range) if params.laser_min_range > 0.0 else scan.range_min
    angles = scan.angle_min + scan.angle_increment * picked
    with np.errstate(invalid="ignore"):
        is_hit = (ranges > least) & (ranges < reach)
        known = ~np.isnan(ranges)
    directions = base_from_laser.yaw + angles[is_hit]
    return Beams(
        xs=base_from_laser.x + ranges[is_hit] * np.cos(directions),
        ys=base_from_laser.y + ranges[is_hit] * np.sin(directions),
        mount=base_from_laser,
        angles=angles[known],
        ranges=np.where(is_hit, ranges, reach)[known],
        reach=reach,
        frame=scan.frame_id,
    )


class LikelihoodFieldModel:
    """Scores each beam's end by its distance to the nearest obstacle: sum of cubed probabilities.

    Args:
        grid: the map.
        params: of amcl.
    """

    def __init__(self, grid: Grid, params: AmclParams) -> None:
        self._params = params
        self.distances = obstacle_distances(grid, params.laser_likelihood_max_dist)
        self._table = _Table(self.distances, params, np.power, 3.0)

    def weigh(self, poses: Array, beams: Beams) -> Weighing | None:
        """Likelihood (1 + sum of p^3)^3, fit: mean p^3."""
        if not len(beams.xs):
            return None
        sums = _summed(poses, beams, self._table.at(beams.reach))
        return Weighing(_sharpened(sums), sums / len(beams.xs), sums)


class LikelihoodFieldProbModel:
    """As `LikelihoodFieldModel`, but a product of probabilities that skips beams which few particles see.

    Args:
        grid: the map.
        params: of amcl.
    """

    def __init__(self, grid: Grid, params: AmclParams) -> None:
        self._params = params
        self.distances = obstacle_distances(grid, params.laser_likelihood_max_dist)
        self._table = _Table(self.distances, params, _log, 0.0)

    def weigh(self, poses: Array, beams: Beams) -> Weighing | None:
        """Likelihood: product of p, scaled to a largest of 1; fit: its geometric mean."""
        xs, ys = self._agreed(poses, beams)
        if not len(xs):
            return None
        used = Beams(xs, ys, beams.mount, beams.angles, beams.ranges, beams.reach)
        sums = _summed(poses, used, self._table.at(beams.reach))
        return Weighing(np.exp(sums - sums.max()), np.exp(sums / len(xs)), np.zeros(len(sums)))

    def _agreed(self, poses: Array, beams: Beams) -> tuple[Array, Array]:
        p = self._params
        if not p.do_beamskip or not len(beams.xs) or not _is_converged(poses):
            return beams.xs, beams.ys
        counts = np.empty(len(beams.xs), dtype=np.int64)
        field = self.distances
        kernels.count_agreement(
            poses,
            beams.xs,
            beams.ys,
            field.values,
            field.origin_x,
            field.origin_y,
            field.resolution,
            p.beam_skip_distance,
            counts,
        )
        kept = counts > p.beam_skip_threshold * len(poses)
        if 1.0 - kept.mean() > p.beam_skip_error_threshold:  # then the filter is wrong, not the beams
            return beams.xs, beams.ys
        return beams.xs[kept], beams.ys[kept]


class BeamModel:
    """Scores each beam's length by a ray on the map: hits, early ends, misses and noise; sum of cubed probabilities.

    Args:
        grid: the map.
        params: of amcl.
    """

    def __init__(self, grid: Grid, params: AmclParams) -> None:
        p = params
        self.distances = blocked_distances(grid, p.laser_likelihood_max_dist)
        mixture = [
            p.laser_z_hit,
            p.laser_z_short,
            p.laser_z_max,
            p.laser_z_rand,
            p.laser_sigma_hit,
            p.laser_lambda_short,
        ]
        self._mixture = np.array(mixture)

    def weigh(self, poses: Array, beams: Beams) -> Weighing | None:
        """Likelihood (1 + sum of p^3)^3, fit: mean p^3."""
        if not len(beams.ranges):
            return None
        field = self.distances
        sums = np.empty(len(poses))
        kernels.sum_beam_model(
            poses,
            np.array(beams.mount),
            beams.angles,
            beams.ranges,
            field.values,
            field.origin_x,
            field.origin_y,
            field.resolution,
            beams.reach,
            self._mixture,
            sums,
        )
        return Weighing(_sharpened(sums), sums / len(beams.ranges), sums)


def _sharpened(sums: Array) -> Array:
    """Likelihood from sums of cubed probabilities."""
    factor = 1.0 + sums
    cubes: Array = factor * factor * factor
    return cubes


def _is_converged(poses: Array) -> bool:
    """Whether all particles are at one place, upstream's condition for skipping beams."""
    off = np.abs(poses[:, :2] - poses[:, :2].mean(axis=0))
    return bool(off.max() <= CONVERGED_M)


MODELS: dict[str, type[LikelihoodFieldModel] | type[LikelihoodFieldProbModel] | type[BeamModel]] = {
    "likelihood_field": LikelihoodFieldModel,
    "likelihood_field_prob": LikelihoodFieldProbModel,
    "beam": BeamModel,
}


def _log(p: Array, _power: float) -> Array:
    logs: Array = np.log(np.maximum(p, 1e-12))
    return logs


class _Table:
    """Value of each cell for one beam; recomputed when the sensor's reach changes."""

    def __init__(
        self, distances: Field, params: AmclParams, shape: Callable[[Array, float], Array], power: float
    ) -> None:
        self._distances = distances
        self._params = params
        self._shape = shape
        self._power = power
        self._reach = float("nan")
        self._field = distances

    def at(self, reach: float) -> Field:
        if reach != self._reach:
            p = self._params
            distances = self._distances.values.astype(np.float64)
            hit = p.laser_z_hit * np.exp(-(distances**2) / (2.0 * p.laser_sigma_hit**2))
            probability = hit + p.laser_z_rand / reach
            self._field = self._distances.mapped(self._shape(probability, self._power))
            self._reach = reach
        return self._field


def _summed(poses: Array, beams: Beams, field: Field) -> Array:
    sums = np.empty(len(poses))
    kernels.sum_over_beams(
        poses, beams.xs, beams.ys, field.values, field.origin_x, field.origin_y, field.resolution, sums
    )
    return sums
