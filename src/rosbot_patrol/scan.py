"""A planar laser scan as a plain record, its check, and its projection to the level.

Every user of scans takes the same two steps. `scan_problem` says why a scan is unusable. `level_scan` converts the scan
of a laser that looks backwards, hangs upside down or is slightly tilted to that of an upright laser at a planar pose.
Nobody after that has to consider roll and pitch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import LaserTilted
from rosbot_patrol.geometry import Pose2D, Transform, transform_points

Array = NDArray[np.float64]

MAX_TILT = math.radians(10.0)  # beyond it a laser at 0.16 m sees the floor from 0.9 m on instead of the room
_LEVEL = math.radians(0.5)  # a smaller tilt is ignored: lengths are off by 0.004 %
_NO_LIMIT = 1e3  # a larger range_max, such as inf or the largest float32, means "no limit" [m]
_ENDLESS = 1e9  # larger ranges mean no hit: drivers write inf, or the largest float32 [m]
_FARTHEST = 100.0  # reach of a scan without a limit; if half of the readings are farther, the unit is wrong [m]
_BLIND_TO = 3.0  # largest plausible range_min [m]
_SHORTEST = 0.1  # smallest plausible range_max [m]
_LEAST_STEP = 1e-5  # finest angle_increment; the finest lidars have 2e-4 [rad]
_LARGEST_START = 2.0 * math.tau  # of angle_min: drivers use -pi, 0, or a turn more [rad]
_TURN = 1.1  # maximum turns in a scan: real ones exceed one by an increment or two
_BEYOND = 3.0  # codes for "no echo" are at most this many times range_max, such as 65.5 m for 30
_MARGIN = 5.0  # or so much farther [m]
_NOTHING = 0.01  # nearer points are the lidar itself [m]
_FEW = 0.01  # a smaller share of hits may be stray readings of a covered lidar


@dataclass(frozen=True, kw_only=True)
class LaserScan:
    """One scan (sensor_msgs/LaserScan without a ROS header).

    Attributes:
        stamp: time of the first ray [s]; NaN where the message has none.
        frame_id: frame of the sensor; angle 0 is its x axis, counter-clockwise positive.
        angle_min: angle of the first beam [rad]; angle_increment: from beam to beam, negative for clockwise [rad].
        range_min, range_max: beams outside are no measurement [m]; range_max may be inf.
        ranges: beam lengths [m], shape (N,): inf where nothing was hit, NaN where nothing was measured.
    """

    stamp: float
    frame_id: str
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: Array

    @property
    def angles(self) -> Array:
        """Angle of each beam [rad], shape (N,)."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges))

    @property
    def is_hit(self) -> NDArray[np.bool_]:
        """Which beams measured something, shape (N,); 0 is what drivers send for "no echo"."""
        with np.errstate(invalid="ignore"):
            in_bounds = (self.ranges >= self.range_min) & (self.ranges <= self.range_max)
            return in_bounds & (self.ranges > 0.0) & (self.ranges < _ENDLESS)

    @property
    def reach(self) -> float:
        """Range up to which a beam without a hit is free [m]: range_max, or 100 m for a scan without an upper limit."""
        return self.range_max if self.range_max < _NO_LIMIT else _FARTHEST


def scan_points(scan: LaserScan) -> Array:
    """End points of the beams that hit, in the sensor's frame [m], shape (N, 2)."""
    hit = scan.is_hit
    lengths, angles = scan.ranges[hit], scan.angles[hit]
    return np.column_stack((lengths * np.cos(angles), lengths * np.sin(angles)))


def is_silent_range(distance: float) -> bool:
    """Whether a range sensor's reading is empty: NaN, or the negative number of a broken one (-inf: too near)."""
    return math.isnan(distance) or (math.isfinite(distance) and distance < 0.0)


# Level ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LevelScan:
    """A scan projected to the plane of the floor, as an upright laser would have measured it.

    Attributes:
        scan: angles as seen from above, ranges over the floor.
        pose: of that upright laser, in the requested frame.
        height: of the laser in that frame [m].
        rises: height gain of each beam per metre over the floor, shape (N,); None for a level laser.
    """

    scan: LaserScan
    pose: Pose2D
    height: float = 0.0
    rises: Array | None = None

    @property
    def points(self) -> Array:
        """Points that the beams hit, in the requested frame [m], shape (N, 2)."""
        return transform_points(self.pose, scan_points(self.scan))


def level_scan(scan: LaserScan, frame_from_laser: Transform, frame: str) -> LevelScan:
    """Project a scan to the level in a frame.

    A laser that hangs upside down sees the same as an upright one with its angles negated. A tilted one has its beams
    projected; their directions are then off by at most a quarter of the squared tilt (0.4 deg at the limit).

    Args:
        scan: a usable scan (see `scan_problem`).
        frame_from_laser: place and orientation of the laser.
        frame: its name, for the error message.

    Raises:
        LaserTilted: by more than 10 deg.
    """
    qx, qy, qz, qw = frame_from_laser[3:]
    upright = 1.0 - 2.0 * (qx * qx + qy * qy) / (qx * qx + qy * qy + qz * qz + qw * qw)  # z of the sensor's z axis
    tilt = math.acos(min(abs(upright), 1.0))
    if not tilt <= MAX_TILT:
        raise LaserTilted(frame, scan.frame_id, tilt)
    if upright < 0.0:
        scan = replace(scan, angle_min=-scan.angle_min, angle_increment=-scan.angle_increment)
    if tilt > _LEVEL:
        return _projected(scan, frame_from_laser, is_upside_down=upright < 0.0)
    return LevelScan(scan, frame_from_laser.pose, frame_from_laser.z)


def _projected(scan: LaserScan, frame_from_laser: Transform, *, is_upside_down: bool) -> LevelScan:
    """A tilted scan, projected to the floor, with angles seen from above."""
    rotation = frame_from_laser.rotation
    if is_upside_down:
        rotation[:, 1] *= -1.0
    yaw = math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])  # the nearest turn in the plane
    angles = scan.angles
    along = rotation[:, :2] @ np.stack((np.cos(angles), np.sin(angles)))
    shares = np.hypot(along[0], along[1])
    hit = scan.is_hit
    with np.errstate(invalid="ignore"):
        ranges = np.where(scan.ranges < scan.range_min, -math.inf, scan.ranges)
    ranges[hit] *= shares[hit]
    level = replace(scan, ranges=ranges, range_min=scan.range_min * float(shares.min()))
    pose = Pose2D(frame_from_laser.x, frame_from_laser.y, yaw)
    return LevelScan(level, pose, frame_from_laser.z, along[2] / shares)


# Judge ---------------------------------------------------------------------------------------------------------------


def scan_problem(scan: LaserScan) -> str:
    """Reason why a scan is unusable, "" if it can be used.

    A beam at +inf has met nothing (REP 117), so a scan of +inf only means "nothing is there", as in a large hall. A
    covered lidar whose driver writes inf for "no echo" looks the same; only a camera or a map could tell them apart.
    Readings of 0, -inf, NaN or below range_min are empty. A few hits make a scan usable: at least a hundredth of all
    beams. With fewer hits, half of the beams must be +inf.

    Returns:
        The problem in one sentence, which stays the same from scan to scan.
    """
    if not len(scan.ranges):
        return "it has no beams"
    if not math.isfinite(scan.stamp):
        return "it has no time: its stamp is 0, the driver has to set it"
    return _angle_problem(scan) or _bound_problem(scan) or _reading_problem(scan)


def _angle_problem(scan: LaserScan) -> str:
    start, step, beams = scan.angle_min, scan.angle_increment, len(scan.ranges)
    if not (math.isfinite(start) and math.isfinite(step)):
        return f"its angles make no sense (angle_min {start:g}, angle_increment {step:g})"
    if abs(step) < _LEAST_STEP:
        return f"its angle_increment is {step:g} rad: all beams look the same way"
    turns = (beams - 1) * abs(step) / math.tau
    if turns > _TURN or abs(start) > _LARGEST_START:
        return (
            f"its angles go round {turns:.1f} times from {start:g} rad on (angle_increment {step:g}, {beams} beams):"
            " are they degrees instead of radians?"
        )
    return ""


def _bound_problem(scan: LaserScan) -> str:
    low, high = scan.range_min, scan.range_max
    if not 0.0 <= low < high:  # NaN too
        return f"its bounds make no sense (range_min {low:g}, range_max {high:g})"
    if low > _BLIND_TO or high < _SHORTEST:
        return f"its bounds are no lidar's (range_min {low:g}, range_max {high:g}): are its figures metres?"
    return ""


def _reading_problem(scan: LaserScan) -> str:
    ranges, high = scan.ranges, scan.range_max
    farthest = min(max(_BEYOND * high, high + _MARGIN), _FARTHEST)
    with np.errstate(invalid="ignore"):
        ahead = ranges >= max(scan.range_min, _NOTHING)  # hits, what lies beyond, and +inf
        nothing = np.count_nonzero(ranges >= _ENDLESS)
        absurd = np.count_nonzero(ranges > farthest) - nothing
        sensible = np.count_nonzero(ahead & (ranges <= min(high, farthest)))
        answers = np.count_nonzero(ahead) - nothing
    few = _FEW * len(ranges)
    if absurd > max(sensible, few):
        return (
            f"most of its readings are farther than {farthest:g} m (range_max {high:g}):"
            " are they millimetres or centimetres instead of metres?"
        )
    if answers < max(few, 1.0) and nothing < 0.5 * len(ranges):
        return (
            "its beams say nothing (0, NaN or nearer than range_min):"
            " is the lidar covered, does it stand still, is its cable loose?"
        )
    return ""
