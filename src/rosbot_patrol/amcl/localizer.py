"""amcl without ROS: odometry and scans in, pose on the map out.

The decisions are upstream's. An update runs after the odometry has moved by `update_min_d` in x or in y or turned by
`update_min_a`, once for each laser. Every `resample_interval`-th update resamples; only then, and after a start, is a
pose published. Beyond upstream, it judges whether the estimate can be trusted, and searches the map if not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.motion_model import OdometryNoise, move_particles
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particles.kld import KldRule
from rosbot_patrol.amcl.particles.odometry_track import OdometryTrack, Reading
from rosbot_patrol.amcl.particles.particle_filter import Estimate, ParticleFilter
from rosbot_patrol.amcl.scan_model.known_map import KnownMap
from rosbot_patrol.amcl.scan_model.sensor_model import Beams, pick_beams
from rosbot_patrol.amcl.seeker import Seeker
from rosbot_patrol.amcl.trust import State, Trust, Witness, agreement
from rosbot_patrol.geometry import Pose2D, angle_difference, compose, invert
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

WATCH_S = 0.2  # time between comparisons of the estimate with a scan


@dataclass(frozen=True)
class Outcome:
    """Result of one scan.

    Attributes:
        updated: the particles were moved and weighed.
        resampled: they were resampled.
        estimate: the pose to publish, None if there is no new one.
        is_blind: the particles were moved, but no beam of the scan could weigh them.
        is_late: a newer scan came before; this one was ignored.
        is_found: the search has found the robot, and the estimate has moved there.
    """

    updated: bool = False
    resampled: bool = False
    estimate: Estimate | None = None
    is_blind: bool = False
    is_late: bool = False
    is_found: bool = False


class Localizer:
    """Localises one robot on one map.

    Args:
        params: of amcl.
        rng: source of random numbers; a seeded one makes every result repeatable.
    """

    def __init__(self, params: AmclParams, rng: np.random.Generator) -> None:
        self._rng = rng
        self._map: KnownMap | None = None
        self._track = OdometryTrack()
        self._odometry: Pose2D | None = None  # at the last update
        self._is_start = True
        self._frames: set[str] = set()  # of the lasers
        self._due: set[str] = set()  # lasers that have not weighed the particles since the last motion
        self._updates = 0
        self._forced = False
        self._seeker: Seeker | None = None
        self._was_asked = False  # a search was requested, whatever the trust
        self._watched = -math.inf
        self.estimate: Estimate | None = None
        self.map_from_odom: Pose2D | None = None
        self._take(params)
        self.filter = ParticleFilter(self._rule, alpha_slow=self._slow, alpha_fast=self._fast, rng=rng)
        self.set_pose(*start_of(params))

    def _take(self, params: AmclParams) -> None:
        self._params = params
        self._alphas = OdometryNoise(
            alpha1=params.odom_alpha1,
            alpha2=params.odom_alpha2,
            alpha3=params.odom_alpha3,
            alpha4=params.odom_alpha4,
            alpha5=params.odom_alpha5,
        )
        self._rule = KldRule(
            least=min(params.min_particles, params.max_particles),
            most=params.max_particles,
            error=params.kld_err,
            z=params.kld_z,
        )
        self._slow, self._fast = params.recovery_alpha_slow, params.recovery_alpha_fast
        self._witness = Witness(lost_below=params.trust_lost_below, sure_above=params.trust_sure_above)

    @property
    def has_map(self) -> bool:
        """Whether there is a map to localise on."""
        return self._map is not None

    @property
    def trust(self) -> Trust:
        """Trust in the estimate."""
        return self._witness.trust

    @property
    def is_seeking(self) -> bool:
        """Whether a search of the whole map is running."""
        return self._seeker is not None

    def reconfigure(self, params: AmclParams) -> None:
        """Use other parameters from now on; the particles and the robot's start stay.

        Raises:
            MapError: the map cannot be used with them.
        """
        known = None if self._map is None else KnownMap(self._map.grid, params, self._rng)
        self._take(params)
        self._map, self._seeker = known, None
        self.filter.configure(self._rule, alpha_slow=self._slow, alpha_fast=self._fast)

    def set_map(self, grid: Grid) -> None:
        """Use a map; the particles stay.

        Raises:
            MapError: the map is turned or empty, or its place is invalid.
        """
        self._map, self._seeker = KnownMap(grid, self._params, self._rng), None
        self._witness.forget()

    def set_pose(self, pose: Pose2D, covariance: Array, odom_from_base: Pose2D | None = None) -> None:
        """Restart around a pose.

        Args:
            pose: map_from_base.
            covariance: of x, y, yaw, shape (3, 3).
            odom_from_base: the odometry at which the robot was there; None: it is there at the next scan.
        """
        self.filter.spread_about(pose, covariance)
        self._start_from(odom_from_base)
        self._seeker, self._was_asked = None, False

    def _start_from(self, odom_from_base: Pose2D | None) -> None:
        self._odometry, self._is_start = odom_from_base, True
        self._witness.forget()

    def localize_globally(self) -> bool:
        """Restart with particles anywhere on the free floor; False if the map has none."""
        if self._map is None or not self._map.floor.area:
            return False
        self.filter.spread_over(self._map.floor.random_poses)
        self._start_from(None)
        self.seek()
        return True

    def seek(self) -> bool:
        """Start a search of the whole map, whatever the trust; False if that is impossible.

        The present estimate stays until the search has found a place that the scans of several updates support.
        """
        if self._map is None or not self._map.floor.area or self._params.seek == "never":
            return False
        self._begin_search(self._map)
        self._was_asked = True
        return True

    def _begin_search(self, known: KnownMap) -> None:
        self._seeker = Seeker(known.model, known.wide, known.obstacles, known.floor, self._rng)
        self._was_asked = False

    def request_update(self) -> None:
        """Update at the next scan even without motion."""
        self._forced = True

    def update(self, scan: LaserScan, odom_from_base: Pose2D, base_from_laser: Pose2D) -> Outcome:
        """Process a scan and the odometry at its time.

        Args:
            scan: a level scan.
            odom_from_base: the robot in the odometry's frame at the scan's stamp.
            base_from_laser: of the level scan.
        """
        known = self._map
        if known is None:
            return Outcome()
        reading = self._track.classify(scan.stamp, odom_from_base)
        if reading is Reading.LATE:
            return Outcome(is_late=True)
        if reading is Reading.RESTART:
            self._restart(odom_from_base)
        self._track.follow(scan.stamp, odom_from_base)
        is_due = self._is_due(scan.frame_id, odom_from_base)
        is_watched = not 0.0 <= scan.stamp - self._watched < WATCH_S
        if not (is_due or is_watched or self._seeker):
            return Outcome()
        beams = pick_beams(scan, base_from_laser, self._params)
        outcome = self._update(known, beams, odom_from_base) if is_due else Outcome()
        if is_watched:
            self._watch(known, beams, scan.stamp, odom_from_base)
        return self._search(known, beams, odom_from_base) or outcome

    def _is_due(self, frame: str, odometry: Pose2D) -> bool:
        """Whether this laser must still weigh the last motion; each does once."""
        self._frames.add(frame)
        if self._is_start or self._forced or self._has_moved(odometry):
            self._due = set(self._frames)
        self._forced = False
        return frame in self._due

    def _update(self, known: KnownMap, beams: Beams, odometry: Pose2D) -> Outcome:
        is_start = self._is_start
        if is_start:
            self._updates = 0
        if self._odometry is not None:
            self._move(self.filter.poses, self._odometry, odometry)
        self._odometry, self._is_start = odometry, False
        self._due.discard(beams.frame)
        weighing = known.model.weigh(self.filter.poses, beams)
        is_blind = weighing is None
        if weighing is not None:
            self.filter.weigh(weighing)
        estimate = self.filter.estimate()  # before resampling, which discards the fit of each particle
        resampled = self._resample_when_due(known)
        if not (resampled or is_start):
            return Outcome(updated=True, is_blind=is_blind)
        self._give_out(estimate, odometry)
        return Outcome(updated=True, resampled=resampled, estimate=estimate, is_blind=is_blind)

    def _give_out(self, estimate: Estimate, odometry: Pose2D) -> None:
        self.estimate = estimate
        self.map_from_odom = compose(estimate.pose, invert(odometry))

    def _move(self, poses: Array, start: Pose2D, end: Pose2D) -> None:
        move_particles(poses, start, end, self._params.odom_model_type, self._alphas, rng=self._rng)

    def _resample_when_due(self, known: KnownMap) -> bool:
        self._updates += 1
        if self._updates % self._params.resample_interval:
            return False
        if self._params.selective_resampling and self.filter.effective_share > 0.5:
            return False
        self.filter.resample(known.floor.random_poses)
        return True

    def _has_moved(self, odometry: Pose2D) -> bool:
        if self._odometry is None:
            return True
        p = self._params
        return (
            abs(odometry.x - self._odometry.x) > p.update_min_d
            or abs(odometry.y - self._odometry.y) > p.update_min_d
            or abs(angle_difference(odometry.yaw, self._odometry.yaw)) > p.update_min_a
        )

    def _restart(self, odometry: Pose2D) -> None:
        """Continue after the odometry has restarted: the jump is ignored, the motion before it is kept."""
        last = self._track.last
        if last is None:
            return
        if self._odometry is not None:
            if last != self._odometry:
                self._move(self.filter.poses, self._odometry, last)
            self._odometry = odometry
        if self._seeker is not None:
            self._seeker.restart(last, odometry, self._move)
        if self.map_from_odom is not None:
            self.map_from_odom = compose(compose(self.map_from_odom, last), invert(odometry))

    # Trust and search

    def _watch(self, known: KnownMap, beams: Beams, stamp: float, odometry: Pose2D) -> None:
        """Compare the estimate with the scan."""
        if self.map_from_odom is None or self.estimate is None:
            return
        self._watched = stamp
        pose = compose(self.map_from_odom, odometry)
        trust = self._witness.hear(stamp, agreement(pose, beams, known.obstacles), self.estimate)
        if trust.state is State.LOST and self._seeker is None and self._params.seek == "lost" and known.floor.area:
            self._begin_search(known)
        elif trust.state is State.LOCALISED and self._seeker is not None and not self._was_asked:
            self._seeker = None

    def _search(self, known: KnownMap, beams: Beams, odometry: Pose2D) -> Outcome | None:
        """Continue a search; its result becomes the estimate."""
        seeker = self._seeker
        if seeker is None or not seeker.update(beams, odometry, self._move):
            return None
        found = seeker.found(math.nan if self._was_asked else self.trust.agreement)
        if found is None:
            return None
        self._seeker, self._was_asked = None, False
        self.filter.set_particles(seeker.near(found.pose))
        self._odometry, self._is_start, self._updates = odometry, False, 0
        estimate = self.filter.estimate()
        self._give_out(estimate, odometry)
        self._witness.forget()
        self._witness.hear(self._watched, agreement(estimate.pose, beams, known.obstacles), estimate)
        return Outcome(updated=True, estimate=estimate, is_found=True)


def start_of(params: AmclParams) -> tuple[Pose2D, Array]:
    """Initial pose from the parameters, and its covariance, shape (3, 3)."""
    p = params
    pose = Pose2D(p.initial_pose_x, p.initial_pose_y, p.initial_pose_a)
    return pose, np.diag([p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa])
