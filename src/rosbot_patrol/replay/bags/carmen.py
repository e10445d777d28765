"""Reader of lidar logs in CARMEN's text format: FLASER and ROBOTLASER1 lines as scans with poses; simulated odometry.

    FLASER n r1 .. rn x y theta odom_x odom_y odom_theta ipc_time host logger_time
    ROBOTLASER1 type start_angle field_of_view resolution range_max accuracy remission_mode n r1 .. rn m s1 .. sm
        laser_x laser_y laser_theta robot_x robot_y robot_theta tv rv forward side turn ipc_time host logger_time

An FLASER covers half a turn, from -pi/2 on; its beams are pi/n or, with n odd, pi/(n - 1) apart. The stored pose is the
laser's own, which is the reference of a corrected log. Lines of other kinds are ignored.
"""

from __future__ import annotations

import gzip
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import PatrolError
from rosbot_patrol.geometry import Pose2D, angle_difference, compose, invert, wrap_angle
from rosbot_patrol.scan import LaserScan

Array = NDArray[np.float64]

RANGE_MAX = 40.0  # m; beams beyond are misses
TURN_PER_TURN, TURN_PER_METRE = 0.02, 0.005
DRIVE_PER_METRE, DRIVE_PER_TURN = 0.02, 0.005
STILL = 0.01  # m; a shorter motion has no reliable direction


class LogError(PatrolError):
    """Error: a lidar log cannot be read; names the file and the reason."""


class LoggedScan(NamedTuple):
    """One scan and its pose in the log."""

    scan: LaserScan
    pose: Pose2D


@dataclass(frozen=True)
class CarmenLog:
    """A log's scans, and their poses as rows x, y, yaw, shape (N, 3)."""

    scans: list[LaserScan]
    poses: Array


def read_log(path: Path | str, *, range_max: float = RANGE_MAX) -> CarmenLog:
    """Read all scans of a log, plain or gzipped.

    Raises:
        LogError: the file cannot be read, one of its lines is invalid, or it has no scan.
    """
    scans, poses = [], []
    try:
        for logged in parse_lines(_lines(Path(path)), name=str(path), range_max=range_max):
            scans.append(logged.scan)
            poses.append(logged.pose)
    except (OSError, EOFError, zlib.error) as err:
        raise LogError(f"{path}: cannot be read ({err}), expected a CARMEN log, plain or gzipped") from err
    if not scans:
        raise LogError(f"{path}: holds no FLASER or ROBOTLASER1 line, expected a CARMEN log")
    return CarmenLog(scans, np.array(poses, dtype=np.float64))


def _lines(path: Path) -> Iterator[str]:
    with path.open("rb") as file:
        is_packed = file.read(2) == b"\x1f\x8b"
    with gzip.open(path) if is_packed else path.open("rb") as lines:
        for line in lines:
            yield line.decode("utf-8", "replace")


def parse_lines(lines: Iterator[str], *, name: str = "log", range_max: float = RANGE_MAX) -> Iterator[LoggedScan]:
    """The scans in a log's lines; raises LogError, which names the line."""
    for number, line in enumerate(lines, 1):
        words = line.split()
        kind = words[0] if words else ""
        if kind not in ("FLASER", "ROBOTLASER1"):
            continue
        try:
            yield (_front_laser if kind == "FLASER" else _robot_laser)(words, range_max)
        except (ValueError, IndexError) as err:
            raise LogError(f"{name}: line {number}, {kind}, makes no sense: {err}") from err


def _front_laser(words: list[str], range_max: float) -> LoggedScan:
    count = _count(words[1])
    _require(words, 2 + count + 9)
    ranges, rest = _numbers(words[2 : 2 + count]), words[2 + count :]
    step = math.pi / (count - count % 2)
    scan = _scan(ranges, -0.5 * math.pi, step, range_max, float(rest[6]))
    return LoggedScan(scan, _pose(rest[:3]))


def _robot_laser(words: list[str], range_max: float) -> LoggedScan:
    start, _, step, own_max = (float(word) for word in words[2:6])
    count = _count(words[8])
    at = 9 + count
    _require(words, at + 1)
    rest = at + 1 + int(words[at])
    _require(words, rest + 14)
    ranges = _numbers(words[9:at])
    scan = _scan(ranges, start, step, min(range_max, own_max), float(words[rest + 11]))
    return LoggedScan(scan, _pose(words[rest : rest + 3]))


def _count(word: str) -> int:
    count = int(word)
    if count < 2:
        raise ValueError(f"{count_of(count, 'beam')}, expected 2 at least")
    return count


def _require(words: list[str], count: int) -> None:
    if len(words) < count:
        raise ValueError(f"it has {count_of(len(words), 'word')}, expected {count} at least")


def _numbers(words: list[str]) -> Array:
    return np.array(words, dtype=np.float64)


def _pose(words: list[str]) -> Pose2D:
    x, y, yaw = (float(word) for word in words)
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(yaw)):
        raise ValueError(f"({x}, {y}, {yaw}) is no pose")
    return Pose2D(x, y, wrap_angle(yaw))


def _scan(ranges: Array, start: float, step: float, range_max: float, stamp: float) -> LaserScan:
    ranges[~(ranges < range_max)] = np.inf
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=start,
        angle_increment=step,
        range_min=0.01,
        range_max=range_max,
        ranges=ranges,
    )


def noisy_odometry(poses: Array, rng: np.random.Generator) -> Array:
    """Make wheel odometry from a path: its motions as rotation, translation and rotation, each with Gaussian noise.

    Standard deviations: each rotation `TURN_PER_TURN` of itself + `TURN_PER_METRE` per metre driven; the translation
    `DRIVE_PER_METRE` of itself + `DRIVE_PER_TURN` per radian turned. A backward motion is one, not two half turns. A
    motion shorter than `STILL` has no direction and begins without rotation.

    Args:
        poses: the reference x, y, yaw, shape (N, 3).
        rng: source of the noise.

    Returns:
        Odometry that begins at (0, 0, 0), shape (N, 3).
    """
    noise = rng.standard_normal((len(poses), 3))
    odometry = [Pose2D()]
    for before, after, errors in zip(poses[:-1], poses[1:], noise[1:], strict=True):
        move = compose(invert(Pose2D(*before)), Pose2D(*after))
        odometry.append(compose(odometry[-1], _noisy(move, errors)))
    return np.array(odometry)


def _noisy(move: Pose2D, errors: Array) -> Pose2D:
    way = math.hypot(move.x, move.y)
    first = math.atan2(move.y, move.x) if way >= STILL else 0.0
    drive = way if way >= STILL else move.x
    aside = 0.0 if way >= STILL else move.y
    if abs(first) > 0.5 * math.pi:
        first, drive = wrap_angle(first + math.pi), -drive
    second = angle_difference(move.yaw, first)
    turned = abs(first) + abs(second)
    spread = TURN_PER_METRE * abs(drive)
    first += errors[0] * (TURN_PER_TURN * abs(first) + spread)
    second += errors[2] * (TURN_PER_TURN * abs(second) + spread)
    drive += errors[1] * (DRIVE_PER_METRE * abs(drive) + DRIVE_PER_TURN * turned)
    return compose(compose(Pose2D(0.0, 0.0, first), Pose2D(drive, aside)), Pose2D(0.0, 0.0, second))
