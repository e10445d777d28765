"""amcl without ROS: fed with odometry and scans, it says where on the map the robot is.

The decisions are upstream's: an update once the odometry moved by `update_min_d` in x or in y or turned by
`update_min_a`; every `resample_interval`-th update resamples, and only then (and after a start) is a pose given out.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.kld import KldRule
from rosbot_patrol.amcl.motion_model import OdometryNoise, move_particles
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particle_filter import Estimate, ParticleFilter
from rosbot_patrol.amcl.sensor_model import MODELS, Mount, SensorModel, pick_beams
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, angle_difference, compose, invert
from rosbot_patrol.grid import Grid
from rosbot_patrol.maps.occupancy import FREE
from rosbot_patrol.scan import LaserScan

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

JUMP_M, JUMP_SPEED = 1.0, 5.0  # odometry that moves farther than this and faster is a restart, not a motion


@dataclass(frozen=True)
class Outcome:
    """What one scan brought.

    Attributes:
        updated: the particles were moved and weighed.
        resampled: they were drawn anew.
        estimate: the pose to give out, or None where there is no news.
        is_blind: the particles were moved, but no beam of the scan could weigh them.
    """

    updated: bool = False
    resampled: bool = False
    estimate: Estimate | None = None
    is_blind: bool = False


class Localizer:
    """Localises one robot on one map.

    Args:
        params: of amcl.
        rng: source of all chance; a seeded one makes every result repeatable.
    """

    def __init__(self, params: AmclParams, rng: np.random.Generator) -> None:
        self._params = params
        self._rng = rng
        self._alphas = OdometryNoise(
            alpha1=params.odom_alpha1,
            alpha2=params.odom_alpha2,
            alpha3=params.odom_alpha3,
            alpha4=params.odom_alpha4,
            alpha5=params.odom_alpha5,
        )
        rule = KldRule(
            least=min(params.min_particles, params.max_particles),
            most=params.max_particles,
            error=params.kld_err,
            z=params.kld_z,
        )
        self.filter = ParticleFilter(
            rule, alpha_slow=params.recovery_alpha_slow, alpha_fast=params.recovery_alpha_fast, rng=rng
        )
        self._grid: Grid | None = None
        self._model: SensorModel | None = None
        self._free: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._odometry: Pose2D | None = None  # at the last update; None: start at the next scan
        self._stamp = -math.inf
        self._updates = 0
        self._forced = False
        self.estimate: Estimate | None = None
        self.map_from_odom: Pose2D | None = None
        self.set_pose(*start_of(params))

    @property
    def has_map(self) -> bool:
        """Whether there is a map to localise on."""
        return self._model is not None

    def set_map(self, grid: Grid) -> None:
        """Take a map; the particles stay where they are.

        Raises:
            MapError: the map is turned, empty, or its place makes no sense.
        """
        grid.info.require_aligned("amcl")
        info = grid.info
        if not (0.0 < info.resolution < math.inf and math.isfinite(info.origin_x + info.origin_y) and grid.cells.size):
            raise MapError("amcl", f"a map of {info.width} x {info.height} cells of {info.resolution} m makes no sense")
        self._model = MODELS[self._params.laser_model_type](grid, self._params)
        self._grid = grid
        self._free = np.flatnonzero(grid.cells == FREE)

    def set_pose(self, pose: Pose2D, covariance: Array) -> None:
        """Start anew about a pose; covariance of x, y, yaw, shape (3, 3)."""
        self.filter.spread_about(pose, covariance)
        self._odometry = None

    def localize_globally(self) -> bool:
        """Start anew from anywhere on the free floor; False where the map has none."""
        if not len(self._free):
            return False
        self.filter.spread_over(self._random_poses)
        self._odometry = None
        return True

    def request_update(self) -> None:
        """Update at the next scan even without motion."""
        self._forced = True

    def _random_poses(self, count: int) -> Array:
        """Poses on free cells, shape (count, 3)."""
        assert self._grid is not None
        info = self._grid.info
        iy, ix = np.divmod(self._rng.choice(self._free, count), info.width)
        poses = self._rng.random((count, 3))
        poses[:, 0] = info.origin_x + (ix + poses[:, 0]) * info.resolution
        poses[:, 1] = info.origin_y + (iy + poses[:, 1]) * info.resolution
        poses[:, 2] = (2.0 * poses[:, 2] - 1.0) * math.pi
        return poses

    def update(self, scan: LaserScan, odom_from_base: Pose2D, mount: Mount) -> Outcome:
        """Take in a scan and the odometry at its time.

        Args:
            scan: one sweep.
            odom_from_base: the robot in the odometry's frame at the scan's stamp.
            mount: how the laser sits on the robot.
        """
        if self._model is None:
            return Outcome()
        self._check_restart(scan.stamp, odom_from_base)
        is_start = self._odometry is None
        if not (is_start or self._forced or self._has_moved(odom_from_base)):
            return Outcome()
        if is_start:
            self._updates = 0
        else:
            assert self._odometry is not None
            self._move(self._odometry, odom_from_base)
        self._odometry, self._forced = odom_from_base, False
        weighing = self._model.weigh(self.filter.poses, pick_beams(scan, mount, self._params))
        is_blind = weighing is None
        if weighing is not None:
            self.filter.weigh(weighing)
        estimate = self.filter.estimate()  # before the draw, which forgets how well each particle fits
        resampled = self._resample_when_due()
        if not (resampled or is_start):
            return Outcome(updated=True, is_blind=is_blind)
        self.estimate = estimate
        self.map_from_odom = compose(self.estimate.pose, invert(odom_from_base))
        return Outcome(updated=True, resampled=resampled, estimate=self.estimate, is_blind=is_blind)

    def _move(self, start: Pose2D, end: Pose2D) -> None:
        move_particles(self.filter.poses, start, end, self._params.odom_model_type, self._alphas, self._rng)

    def _resample_when_due(self) -> bool:
        self._updates += 1
        if self._updates % self._params.resample_interval:
            return False
        if self._params.selective_resampling and self.filter.effective_share > 0.5:
            return False
        self.filter.resample(self._random_poses)
        return True

    def _has_moved(self, odometry: Pose2D) -> bool:
        assert self._odometry is not None
        p = self._params
        return (
            abs(odometry.x - self._odometry.x) > p.update_min_d
            or abs(odometry.y - self._odometry.y) > p.update_min_d
            or abs(angle_difference(odometry.yaw, self._odometry.yaw)) > p.update_min_a
        )

    def _check_restart(self, stamp: float, odometry: Pose2D) -> None:
        """Where time or odometry jumped, go on from here without believing the jump."""
        elapsed = stamp - self._stamp
        self._stamp = stamp
        if self._odometry is None:
            return
        way = math.hypot(odometry.x - self._odometry.x, odometry.y - self._odometry.y)
        if elapsed < 0.0:
            log.warning("time went back by %.3f s: going on from the last pose", -elapsed)
        elif way > JUMP_M + self._params.update_min_d + JUMP_SPEED * elapsed:
            log.warning("the odometry jumped by %.2f m in %.2f s: taken as its restart, not as a motion", way, elapsed)
        else:
            return
        self._odometry = odometry
        if self.estimate is not None:
            self.map_from_odom = compose(self.estimate.pose, invert(odometry))


def start_of(params: AmclParams) -> tuple[Pose2D, Array]:
    """Where the parameters say that the robot starts, and the covariance of that, shape (3, 3)."""
    p = params
    pose = Pose2D(p.initial_pose_x, p.initial_pose_y, p.initial_pose_a)
    return pose, np.diag([p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa])


def scan_problem(scan: LaserScan) -> str:
    """Why a scan cannot be used at all, "" where it can."""
    if not len(scan.ranges):
        return "it has no beams"
    if not (math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment) and math.isfinite(scan.stamp)):
        return f"its angles make no sense (angle_min {scan.angle_min}, angle_increment {scan.angle_increment})"
    if not (scan.range_max > 0.0 and math.isfinite(scan.range_max) and math.isfinite(scan.range_min)):
        return f"its bounds make no sense (range_min {scan.range_min}, range_max {scan.range_max})"
    return ""
