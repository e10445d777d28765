"""Core of the node slam_gmapping, without ROS: scans in, maps and corrections out.

The node and its replay over a bag run it.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.slam import Outcome
from rosbot_patrol.gmapping.start import started
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_feed import ScanFeed
from rosbot_patrol.scan_line import PlacedScan
from rosbot_patrol.tf.frames import Frames

log = logging.getLogger(__name__)

_WAITING = 50  # scans: more than a fast lidar sends before an unplaceable scan is dropped and reported
_STRANGE = 0.6  # share of the first scan's beams on walls of a saved map, below which it is probably of another place
_REPEAT = 10.0  # between two warnings about updates [s]


@dataclass(frozen=True)
class Step:
    """Result of one scan.

    Attributes:
        stamp: time of the scan [s].
        outcome: of the update.
        grid: the map, None if none is due (at most one per `map_update_interval`).
    """

    stamp: float
    outcome: Outcome
    grid: Grid | None = None


class GmappingCore:
    """A Slam and all decisions of its node.

    Args:
        params: of slam_gmapping; with `map_file` a saved map is extended.
        frames: transforms.

    Raises:
        MapError: the extent or the saved map is invalid.

    Attributes:
        slam: the maps and poses.
        feed: queue of scans that wait for the odometry.
        correction: map_from_odom, the identity before the first update.
        problem: problem of the last update, "" for none.
    """

    def __init__(self, params: GmappingParams, frames: Frames) -> None:
        self.slam = started(params)
        self.feed = ScanFeed(frames, params.odom_frame, params.base_frame, lost="nothing is mapped", size=_WAITING)
        self.correction = Pose2D()
        self.problem = ""
        self._misfit = ""  # why the saved map is probably wrong
        self._params = params
        self._heard = 0
        self._map_stamp = -math.inf  # stamp of the scan after which the last map was made
        self._warned = -math.inf

    def is_wanted(self) -> bool:
        """Count a scan; returns whether to use it: every `throttle_scans`-th is used."""
        self._heard += 1
        return (self._heard - 1) % self._params.throttle_scans == 0

    def step(self, placed: PlacedScan) -> Step:
        """Process a scan from `feed`."""
        slam, stamp = self.slam, placed.scan.stamp
        outcome = slam.update(placed.scan, placed.odom_from_base, placed.base_from_laser)
        if slam.map_from_odom is not None:
            self.correction = slam.map_from_odom
        if self._params.map_file and outcome.updated and len(slam.stamps) == 1 and outcome.fit < _STRANGE:
            self._misfit = (
                f"{100.0 * outcome.fit:.0f} % of the first scan lies on walls of {self._params.map_file}: is it a map"
                " of this place, and initial_pose_x, _y and _a where the robot is on it?"
            )
        self._note_problem(outcome, placed.scan)
        since = stamp - self._map_stamp
        if not outcome.updated or 0.0 <= since <= self._params.map_update_interval:
            return Step(stamp, outcome)
        self._map_stamp = stamp
        return Step(stamp, outcome, slam.grid())

    def _note_problem(self, outcome: Outcome, scan: LaserScan) -> None:
        """Record the problem of an update, and log it now and then."""
        if outcome.is_blind:
            text = f"no beam of the scan of frame '{scan.frame_id}' measured anything: only the odometry is followed"
        elif outcome.failed:
            count = self._params.particles
            text = f"scan matching failed for {outcome.failed} of {count} particles: they follow the odometry"
        elif self._misfit:
            text = self._misfit
        elif not outcome.updated:
            return
        else:
            text = ""
        self.problem = text
        if text and not 0.0 <= scan.stamp - self._warned <= _REPEAT:
            self._warned = scan.stamp
            log.warning("%s", text)
