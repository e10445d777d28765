"""Core of the node amcl, without ROS: scans, map and given poses in, estimates out.

The node and its replay over a bag run it.
"""

from __future__ import annotations

import logging
import math
import threading
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.amcl.initial_pose import PoseRecord, taken_pose
from rosbot_patrol.amcl.localizer import Localizer, Outcome, start_of
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particles.particle_filter import Estimate
from rosbot_patrol.amcl.trust import State
from rosbot_patrol.geometry import Pose2D, compose
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan_feed import ScanFeed
from rosbot_patrol.scan_line import PlacedScan
from rosbot_patrol.tf.frames import Frames

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Step:
    """Result of one scan.

    Attributes:
        stamp: time of the scan [s].
        outcome: of the localizer.
        map_from_odom: the correction to publish, None if there is none yet or the scan came late.
        particles: shape (N, 3).
    """

    stamp: float
    outcome: Outcome
    map_from_odom: Pose2D | None
    particles: NDArray[np.float64]


class Fix(NamedTuple):
    """Pose of the robot at the newest scan: map_from_base, its estimate, odom_from_base, time [s]."""

    pose: Pose2D
    estimate: Estimate
    odom_from_base: Pose2D
    stamp: float


class AmclCore:
    """A Localizer and all decisions of its node. Thread-safe.

    Args:
        params: of amcl.
        frames: transforms.
        rng: source of random numbers.

    Attributes:
        localizer: for reading; it is changed by the methods here.
        feed: queue of scans that wait for the odometry.
        late: number of scans that came after a newer one.
    """

    def __init__(self, params: AmclParams, frames: Frames, rng: np.random.Generator) -> None:
        self.feed = ScanFeed(frames, params.odom_frame_id, params.base_frame_id, lost="no pose is published")
        self.late = 0
        self._params, self._frames = params, frames
        self._global = params.global_frame_id.lstrip("/")
        self._lock = threading.Lock()  # of the localizer
        self.localizer = Localizer(params, rng)
        self._odom_from_base: Pose2D | None = None
        self._stamp = -math.inf
        self._was_placed = False  # by an initial pose or global localization
        self._was_seeking = False

    # State

    @property
    def is_found(self) -> bool:
        """Whether the robot is localised and no search is running."""
        return self.localizer.trust.state is State.LOCALISED and not self.localizer.is_seeking

    @property
    def stamp(self) -> float:
        """Time of the newest scan used [s], -inf before the first."""
        return self._stamp

    @property
    def pose(self) -> Pose2D | None:
        """map_from_base at the newest scan, None before the first estimate."""
        correction, odometry = self.localizer.map_from_odom, self._odom_from_base
        return None if correction is None or odometry is None else compose(correction, odometry)

    def fix(self) -> Fix | None:
        """The newest pose with its estimate, None before the first."""
        with self._lock:
            pose, estimate, odometry = self.pose, self.localizer.estimate, self._odom_from_base
            if pose is None or estimate is None or odometry is None:
                return None
            return Fix(pose, estimate, odometry, self._stamp)

    # Inputs

    def configure(self, params: AmclParams) -> None:
        """Use other parameters from now on; raises MapError if they do not suit the map."""
        with self._lock:
            self.localizer.reconfigure(params)
            self._params = params

    def hear_map(self, grid: Grid) -> None:
        """Use a map; raises MapError if it is invalid."""
        with self._lock:
            self.localizer.set_map(grid)

    def hear_initial_pose(self, record: PoseRecord, now: float) -> bool:
        """Restart around a given pose; False, with a warning, if it has to be ignored. `now` [s] is for the log."""
        try:
            taken = taken_pose(
                record.pose,
                record.covariance,
                frame=record.frame,
                stamp=record.stamp,
                global_frame=self._global,
                odometry=lambda stamp: self._frames.lookup(self.feed.odom, self.feed.base, stamp),
            )
        except ValueError as err:
            log.warning("initial pose is ignored: %s", err)
            return False
        for note in taken.notes:
            log.warning("%s", note)
        log.info("Setting pose (%.6f): %.3f %.3f %.3f", now, *taken.pose)
        with self._lock:
            self._was_placed = True
            self.localizer.set_pose(taken.pose, taken.covariance, taken.odom_from_base)
            if self._params.force_update_after_initialpose:
                self.localizer.request_update()
        return True

    def localize_globally(self) -> bool:
        """Restart with particles anywhere on the free floor; False if the map has none."""
        with self._lock:
            started = self._was_placed = self.localizer.localize_globally()
        return started

    def seek(self) -> bool:
        """Search the whole map for the robot; False if that is impossible."""
        with self._lock:
            return self.localizer.seek()

    def request_update(self) -> None:
        """Update at the next scan even without motion."""
        with self._lock:
            self.localizer.request_update()

    def resume(self, params: AmclParams, odom_from_base: Pose2D | None) -> None:
        """Restart from the pose in `params`, unless a pose was given already.

        Args:
            params: with the start.
            odom_from_base: the odometry at which the robot was there; None: it is there at the next scan.
        """
        with self._lock:
            if not self._was_placed:
                self.localizer.set_pose(*start_of(params), odom_from_base)

    # Step

    def step(self, placed: PlacedScan) -> Step:
        """Process a scan from `feed`."""
        scan = placed.scan
        with self._lock:
            outcome = self.localizer.update(scan, placed.odom_from_base, placed.base_from_laser)
            correction = None if outcome.is_late else self.localizer.map_from_odom
            particles = self.localizer.filter.poses
            if not outcome.is_late:
                self._odom_from_base, self._stamp = placed.odom_from_base, scan.stamp
        self.late += outcome.is_late
        self._tell_of_search(outcome)
        return Step(scan.stamp, outcome, correction, particles)

    def _tell_of_search(self, outcome: Outcome) -> None:
        if outcome.is_found and outcome.estimate is not None:
            x, y, yaw = outcome.estimate.pose
            log.warning("found the robot at %.2f %.2f %.2f, the estimate has moved there", x, y, yaw)
        was, self._was_seeking = self._was_seeking, self.localizer.is_seeking
        if self._was_seeking and not was:
            log.warning("searching the whole map for the robot: %s", self.localizer.trust.reason or "asked to")
        elif was and not self._was_seeking and not outcome.is_found:
            log.info("the search is over: the estimate came right by itself, or a pose was set")
