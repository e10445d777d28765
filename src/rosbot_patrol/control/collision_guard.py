"""Collision guard: slows and stops the base for obstacles on the commanded arc, whoever commands.

The command is scaled down (its shape is kept) until the robot can stop before its footprint, with a gap in the
direction of motion, meets a point. Points already inside the footprint's margin block only motion that goes deeper, so
the robot can always leave. The lidar is blind closer than its minimum range: obstacles last seen there are remembered
for a while. Range sensors near the floor see what the lidar passes over. A distance that two readings in a row agree on
counts as `min_points` points; it is remembered for a while, too, because the cones are narrow.

An unusable scan (see `scan.scan_problem`) frees nothing; the base then creeps as without a scan.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, compose, driven, invert, transform_points
from rosbot_patrol.params import param
from rosbot_patrol.scan import LaserScan, is_silent_range, scan_points, scan_problem

Array = NDArray[np.float64]

_STEP = 0.01  # along the arc [m]
_TURN_STEP = 0.03  # [rad]
_DEEPER = 0.002  # a point must go this much deeper within `_GLANCE` to count as coming closer [m]
_GLANCE = 0.1  # [s]
_SELF = 0.06  # points deeper inside the footprint than this are the robot itself [m]
_CREEP = 0.05  # a scale below this is a stop
_AGREE = 0.15  # readings of a range sensor that differ by less belong to the same obstacle [m]
_BESIDE = 0.1  # angle from its axis up to which a range sensor's reading shows free space [rad]


@dataclass(frozen=True, kw_only=True)
class GuardParams:
    """Parameters of the collision guard."""

    half_length: float = param(
        0.12, lo=0.01, unit="m", doc="distance from base_link to the front and the rear of the footprint"
    )
    half_width: float = param(0.14, lo=0.01, unit="m", doc="distance from base_link to each side of the footprint")
    gap: float = param(0.05, lo=0.0, unit="m", doc="distance kept from obstacles in the direction of motion")
    slack: float = param(
        0.01, lo=0.0, unit="m", doc="taken off the footprint on the sides that do not lead, for the lidar's noise"
    )
    deceleration: float = param(1.0, lo=0.05, unit="m/s^2", doc="deceleration that the base always reaches")
    turn_deceleration: float = param(
        3.0, lo=0.05, unit="rad/s^2", doc="turning deceleration that the base always reaches"
    )
    latency: float = param(0.2, lo=0.0, unit="s", doc="delay from the measurement to the brake")
    min_points: int = param(2, lo=1, doc="minimum number of beams on an obstacle")
    stale_after: float = param(0.6, lo=0.05, unit="s", doc="maximum age of a scan")
    stale_speed: float = param(0.1, lo=0.0, unit="m/s", doc="maximum speed without a fresh scan")
    stale_turn: float = param(0.4, lo=0.0, unit="rad/s", doc="maximum turning speed without a fresh scan")
    memory: float = param(
        20.0, lo=0.0, unit="s", doc="time for which obstacles closer than the lidar's range_min are remembered"
    )
    range_memory: float = param(3.0, lo=0.0, unit="s", doc="time for which obstacles of a range sensor are remembered")


class RangeReading(NamedTuple):
    """Reading of a range sensor: distance [m] (inf: nothing, -inf: too near), its limits, and base_from_sensor."""

    distance: float
    range_min: float
    range_max: float
    base_from_sensor: Pose2D


class _Met(NamedTuple):
    """Obstacle of a range sensor: (x, y) in the base's frame at the reading, and odom_from_base then."""

    x: float
    y: float
    pose: Pose2D | None
    stamp: float

    def now_in(self, odom_from_base: Pose2D | None) -> Array:
        """The place in the base's frame, shape (1, 2)."""
        point = np.array([[self.x, self.y]])
        if odom_from_base is None or self.pose is None:
            return point
        return transform_points(compose(invert(odom_from_base), self.pose), point)


class Cause(enum.Enum):
    """Why a command is held back; the value is the sentence for it if there is no better one."""

    NONE = ""
    NEAR = "something is near on the way"
    IN_THE_WAY = "something is in the way"
    TURN_ONLY = "something is in the way, turning only"
    BLIND = "nothing is seen"
    SOMEONE = "someone passes"


class Verdict(NamedTuple):
    """Result of the guard: the safe command, its share of the wish (0 to 1), and the reason if it is less than all."""

    twist: Twist2D
    scale: float
    cause: Cause = Cause.NONE
    detail: str = ""

    @property
    def reason(self) -> str:
        """The cause in a sentence, "" if all of the wish is done."""
        return self.detail or self.cause.value


class CollisionGuard:
    """Stores scans and readings, and limits commands. Times [s] are of one clock; poses are odom_from_base or None.

    Args:
        params: sizes, decelerations, limits.

    Attributes:
        problem: reason why the newest scan was ignored, "" if it was used.
    """

    def __init__(self, params: GuardParams) -> None:
        self.problem = ""
        self._params = params
        self._stamp = -math.inf
        self._seen: Array = np.empty((0, 2))  # in the base's frame at the scan
        self._pose: Pose2D | None = None
        self._blind: Array = np.empty((0, 2))  # in odom
        self._blind_since: Array = np.empty(0)
        self._last_met: dict[str, _Met] = {}  # of each range sensor, confirmed or not
        self._met: list[_Met] = []

    def see(self, scan: LaserScan, base_from_laser: Pose2D, now: float, odom_from_base: Pose2D | None = None) -> None:
        """Store a level scan; an unusable one is ignored."""
        self.problem = scan_problem(scan)
        if self.problem:
            return
        points = transform_points(base_from_laser, scan_points(scan))
        if self._is_covered(scan, points):
            self.problem = "its beams end on the robot itself: is the lidar covered?"
            return
        if odom_from_base is not None:
            self._remember(scan.range_min, compose(odom_from_base, base_from_laser), now)
        self._seen = points
        self._pose, self._stamp = odom_from_base, now

    def refuse(self, problem: str) -> None:
        """Ignore the newest scan for a reason outside the guard, such as a tilted laser."""
        self.problem = problem

    def see_range(self, name: str, reading: RangeReading, now: float, odom_from_base: Pose2D | None = None) -> None:
        """Store a reading of a range sensor; NaN and negative numbers are ignored."""
        if is_silent_range(reading.distance):
            return
        sensor = reading.base_from_sensor
        distance = max(reading.distance, reading.range_min)
        nothing = reading.distance >= reading.range_max
        seen_to = reading.range_max if nothing else distance
        self._met = [m for m in self._met if not self._is_past(m, sensor, seen_to, now, odom_from_base)]
        before = self._last_met.pop(name, None)
        if nothing:
            return
        place = transform_points(sensor, np.array([[distance, 0.0]]))[0]
        met = _Met(float(place[0]), float(place[1]), odom_from_base, now)
        self._last_met[name] = met
        if before is None or abs(now - before.stamp) > self._params.stale_after:
            return
        if float(np.hypot(*(before.now_in(odom_from_base)[0] - place))) <= _AGREE:
            self._met.append(met)

    def _is_past(self, met: _Met, sensor: Pose2D, seen_to: float, now: float, odom_from_base: Pose2D | None) -> bool:
        """Whether an obstacle is too old, or lies where a sensor has just looked."""
        if abs(now - met.stamp) > self._params.range_memory:
            return True
        x, y = transform_points(invert(sensor), met.now_in(odom_from_base))[0].tolist()
        return math.hypot(x, y) < seen_to + _AGREE and abs(math.atan2(y, x)) < _BESIDE

    def limit(self, wish: Twist2D, now: float, odom_from_base: Pose2D | None = None) -> Verdict:
        """Safe part of a commanded velocity."""
        if wish == STOP:
            return Verdict(STOP, 1.0)
        reason = self.blind(now)
        if reason:
            return self._without_sight(wish, reason)
        points = self._points(now, odom_from_base)
        scale = self._free_part(wish, points)
        if scale >= _CREEP or wish.wz == 0.0:
            return self._verdict(wish, scale)
        turn = Twist2D(0.0, 0.0, wish.wz)  # the arc is blocked, but the robot may turn out of it
        return self._verdict(turn, self._free_part(turn, points), wish)

    def _verdict(self, wish: Twist2D, scale: float, whole: Twist2D | None = None) -> Verdict:
        if scale < _CREEP:
            return Verdict(STOP, 0.0, Cause.IN_THE_WAY)
        twist = Twist2D(wish.vx * scale, wish.vy * scale, wish.wz * scale)
        if whole is not None and whole != wish:
            return Verdict(twist, 0.0, Cause.TURN_ONLY)
        return Verdict(twist, scale, Cause.NONE if scale >= 0.999 else Cause.NEAR)

    def blind(self, now: float) -> str:
        """Reason why there is no usable scan now, "" if the last one is fresh."""
        age = abs(now - self._stamp)  # the scan may have come after `now` was read
        if age <= self._params.stale_after:
            return ""
        what = "usable scan" if self.problem else "scan"
        reason = f"no {what} yet" if math.isinf(age) else f"the last {what} is {age:.1f} s old"
        return f"{reason}: {self.problem}" if self.problem else reason

    def _without_sight(self, wish: Twist2D, reason: str) -> Verdict:
        p = self._params
        speed = math.hypot(wish.vx, wish.vy)
        parts = [1.0]
        if speed > 0.0:
            parts.append(p.stale_speed / speed)
        if wish.wz != 0.0:
            parts.append(p.stale_turn / abs(wish.wz))
        scale = min(parts)
        twist = Twist2D(wish.vx * scale, wish.vy * scale, wish.wz * scale)
        return Verdict(twist, scale, Cause.BLIND, reason)

    def _points(self, now: float, odom_from_base: Pose2D | None) -> Array:
        """Obstacles seen and remembered, in the base's present frame."""
        p = self._params
        parts = [self._seen]
        if odom_from_base is not None and self._pose is not None:
            base_from_odom = invert(odom_from_base)
            parts = [transform_points(compose(base_from_odom, self._pose), self._seen)]
            if len(self._blind):
                parts.append(transform_points(base_from_odom, self._blind))
        for met in self._met:
            if abs(now - met.stamp) <= p.range_memory:
                parts.append(np.repeat(met.now_in(odom_from_base), p.min_points, axis=0))
        return np.vstack(parts)

    def _remember(self, range_min: float, odom_from_laser: Pose2D, now: float) -> None:
        """Remember obstacles that are now closer than the lidar can see."""
        known, since = self._blind, self._blind_since
        if self._pose is not None and len(self._seen):
            seen = transform_points(self._pose, self._seen)
            known = np.vstack((known, seen))
            since = np.concatenate((since, np.full(len(seen), now)))
        offset = known - np.array([odom_from_laser.x, odom_from_laser.y])
        keep = (np.hypot(offset[:, 0], offset[:, 1]) < range_min) & (now - since < self._params.memory) & (since <= now)
        self._blind, self._blind_since = known[keep], since[keep]

    def _free_part(self, wish: Twist2D, points: Array) -> float:
        """Factor (0 to 1) at which the robot can still stop before it touches a point."""
        p = self._params
        speed = math.hypot(wish.vx, wish.vy)
        stopping = max(speed / p.deceleration, abs(wish.wz) / p.turn_deceleration)
        horizon = p.latency + stopping / 2.0 + _GLANCE
        reach = math.hypot(p.half_length, p.half_width) + p.gap + speed * horizon
        near = points[np.abs(points).max(axis=1) < reach] if len(points) else points
        if len(near) < p.min_points:
            return 1.0
        contact = self._contact_time(wish, near, horizon)
        if math.isinf(contact):
            return 1.0
        return _scale_to_stop(contact, p.latency, stopping)

    def _contact_time(self, wish: Twist2D, points: Array, horizon: float) -> float:
        """Time until the footprint meets `min_points` of the points at the commanded speed [s]; inf: not in sight."""
        speed = math.hypot(wish.vx, wish.vy)
        steps = math.ceil(max(speed * horizon / _STEP, abs(wish.wz) * horizon / _TURN_STEP, 1.0))
        times = np.linspace(0.0, horizon, min(steps, 60) + 1)
        box = self._box(wish)
        depth = _distance_to_box(points[:, 0], points[:, 1], box)
        soon = _seen_from(points, wish, np.array([_GLANCE]))
        deeper = _distance_to_box(soon[:, 0, 0], soon[:, 1, 0], box) < depth - _DEEPER
        counts = ((depth >= 0.0) | deeper) & ~self._is_self(points)
        if counts.sum() < self._params.min_points:
            return math.inf
        moved = _seen_from(points[counts], wish, times)
        hit = _distance_to_box(moved[:, 0], moved[:, 1], box) < 0.0
        last_free = np.maximum(hit.argmax(axis=1) - 1, 0)
        first = np.where(hit.any(axis=1), times[last_free], math.inf)
        return float(np.partition(first, self._params.min_points - 1)[self._params.min_points - 1])

    def _is_covered(self, scan: LaserScan, points: Array) -> bool:
        """Whether most beams hit something, and all hits are the robot itself."""
        is_open = np.count_nonzero(scan.ranges == math.inf) >= 0.5 * len(scan.ranges)
        return bool(len(points)) and not is_open and bool(self._is_self(points).all())

    def _is_self(self, points: Array) -> NDArray[np.bool_]:
        p = self._params
        deep = (-p.half_length + _SELF, p.half_length - _SELF, -p.half_width + _SELF, p.half_width - _SELF)
        return _distance_to_box(points[:, 0], points[:, 1], deep) < 0.0

    def _box(self, wish: Twist2D) -> tuple[float, float, float, float]:
        """Footprint with its gap in the direction of motion: x from, x to, y from, y to."""
        p = self._params
        length, width = p.half_length - p.slack, p.half_width - p.slack
        return (
            -p.half_length - p.gap if wish.vx < 0.0 else -length,
            p.half_length + p.gap if wish.vx > 0.0 else length,
            -p.half_width - p.gap if wish.vy < 0.0 else -width,
            p.half_width + p.gap if wish.vy > 0.0 else width,
        )


def _seen_from(points: Array, twist: Twist2D, times: Array) -> Array:
    """Points in the robot's frame after moving at `twist` for each time, shape (N, 2, T)."""
    x, y, angle = driven(twist, times)
    dx, dy = points[:, 0:1] - x, points[:, 1:2] - y
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack((cos * dx + sin * dy, cos * dy - sin * dx), axis=1)


def _distance_to_box(x: Array, y: Array, box: tuple[float, float, float, float]) -> Array:
    """Distance of points outside a box [m]; negative inside."""
    x_from, x_to, y_from, y_to = box
    dx = np.maximum(x_from - x, x - x_to)
    dy = np.maximum(y_from - y, y - y_to)
    outside = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0))
    return np.where(outside > 0.0, outside, np.maximum(dx, dy))


def _scale_to_stop(contact: float, latency: float, stopping: float) -> float:
    """The largest k <= 1 with k * latency + k^2 * stopping / 2 <= contact (times at the commanded speed [s])."""
    if contact >= latency + stopping / 2.0:
        return 1.0
    if stopping < 1e-9:
        return contact / latency if latency > 0.0 else 1.0
    return (math.sqrt(latency * latency + 2.0 * stopping * contact) - latency) / stopping
