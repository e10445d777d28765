"""What a scan is worth: judged, and laid level (for each user of scans: test_scan_mounts.py)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.errors import LaserTilted, TransformError
from rosbot_patrol.geometry import Transform
from rosbot_patrol.scan import MAX_TILT, LaserScan, level_scan, scan_points, scan_problem

BEAMS = 720
FLOAT32_MAX = float(np.finfo(np.float32).max)


def scan_of(ranges: np.ndarray, **changes: object) -> LaserScan:
    values = {
        "stamp": 10.0,
        "frame_id": "laser",
        "angle_min": -math.pi,
        "angle_increment": math.tau / BEAMS,
        "range_min": 0.15,
        "range_max": 12.0,
        "ranges": np.asarray(ranges, np.float64),
    }
    return LaserScan(**(values | changes))  # type: ignore[arg-type]


def wall() -> np.ndarray:
    """A wall 0.17 m ahead of the lidar, 3 m behind it; the beams between meet nothing."""
    across = np.cos(-math.pi + math.tau / BEAMS * np.arange(BEAMS))
    with np.errstate(divide="ignore"):
        return np.where(across > 0.05, 0.17 / across, np.where(across < -0.05, -3.0 / across, math.inf))


def mixed(value: float, beams: int, rest: float) -> np.ndarray:
    return np.where(np.arange(BEAMS) < beams, value, rest)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """(x, y, z, w) of turns about the fixed axes x, y, z, in this order (REP 103)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2.0), math.sin(a / 2.0)) for a in (roll, pitch, yaw))
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    return x, y, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy


def mount(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Transform:
    return Transform(0.1, -0.05, 0.2, *quaternion(roll, pitch, yaw))


# ---- judged


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"ranges": np.zeros(BEAMS)}, "say nothing"),
        ({"ranges": np.zeros(BEAMS), "range_min": 0.0}, "say nothing"),
        ({"ranges": np.full(BEAMS, math.nan)}, "say nothing"),
        ({"ranges": np.full(BEAMS, -math.inf)}, "say nothing"),
        ({"ranges": np.full(BEAMS, 0.1)}, "say nothing"),  # a hand on it
        ({"ranges": np.full(BEAMS, -1.0)}, "say nothing"),
        ({"ranges": np.where(np.arange(BEAMS) % 2, 0.0, math.nan)}, "say nothing"),
        ({"ranges": mixed(2.0, 5, 0.0)}, "say nothing"),  # covered, with some stray readings
        ({"ranges": mixed(0.0, 700, math.inf)}, "say nothing"),
        ({"ranges": wall() / 1000.0}, "say nothing"),
        ({"ranges": np.full(BEAMS, 0.004), "range_min": 0.0}, "say nothing"),
        ({"ranges": np.empty(0)}, "no beams"),
        ({"range_max": 0.0}, "range_max 0"),
        ({"range_max": math.nan}, "range_max nan"),
        ({"range_max": -12.0}, "range_max -12"),
        ({"range_max": 0.15}, "range_max 0.15"),
        ({"range_max": 0.012, "range_min": 0.00015}, "metres"),
        ({"range_min": math.nan}, "range_min nan"),
        ({"range_min": -1.0}, "range_min -1"),
        ({"range_min": math.inf, "range_max": math.inf}, "range_min inf"),
        ({"ranges": wall() * 1000.0}, "millimetres"),
        ({"ranges": wall() * 1000.0, "range_max": 12000.0}, "millimetres"),
        ({"ranges": wall() * 1000.0, "range_max": 12000.0, "range_min": 150.0}, "metres"),
        ({"ranges": wall() * 1000.0, "range_max": math.inf}, "millimetres"),
        ({"ranges": np.where(wall() < 1.0, wall() * 1000.0, 0.0)}, "millimetres"),
        ({"ranges": wall() * 100.0}, "centimetres"),
        ({"ranges": wall() * 100.0, "range_max": 1200.0, "range_min": 15.0}, "metres"),
        ({"angle_increment": 0.0}, "angle_increment is 0"),
        ({"angle_increment": -0.0}, "angle_increment is"),
        ({"angle_increment": 1e-9}, "angle_increment is 1e-09"),
        ({"angle_increment": math.nan}, "angle_increment nan"),
        ({"angle_increment": math.inf}, "angle_increment inf"),
        ({"angle_increment": 0.5}, "degrees"),
        ({"angle_increment": -0.5, "angle_min": 180.0}, "degrees"),
        ({"angle_min": -180.0}, "degrees"),
        ({"angle_min": math.nan}, "angle_min nan"),
        ({"stamp": math.nan}, "stamp is 0"),
        ({"stamp": math.inf}, "stamp"),
    ],
)
def test_a_scan_that_is_none_is_named(changes: dict[str, object], named: str) -> None:
    assert named in scan_problem(scan_of(**{"ranges": wall(), **changes}))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"ranges": np.full(BEAMS, math.inf)},  # REP 117: nothing is there
        {"ranges": np.full(BEAMS, FLOAT32_MAX), "range_max": FLOAT32_MAX},  # the same, by a driver that knows no inf
        {"ranges": np.full(BEAMS, 13.0)},  # the same, as some drivers say it
        {"ranges": np.full(BEAMS, 65.533), "range_max": 30.0},
        {"ranges": mixed(3.0, 10, math.inf)},  # a hall
        {"ranges": mixed(3.0, 10, 0.0)},  # a hall, by a driver that sends 0 for "no echo"
        {"ranges": mixed(math.nan, 300, math.inf)},
        {"ranges": np.where(np.arange(BEAMS) < 400, 0.0, 3.0)},  # half of it is covered
        {"ranges": mixed(4000.0, 20, 3.0)},  # some are faulty
        {"ranges": mixed(4000.0, 1, math.inf)},
        {"range_max": math.inf},
        {"range_max": FLOAT32_MAX},
        {"range_max": 1e4},  # a placeholder
        {"range_max": 100.0, "ranges": np.full(BEAMS, 90.0)},
        {"range_min": 0.0},
        {"angle_increment": math.tau / (BEAMS - 1)},
        {"angle_increment": 1.002 * math.tau / BEAMS},
        {"angle_increment": -math.tau / BEAMS, "angle_min": math.pi},
        {"angle_min": 0.0},
        {"angle_min": -math.tau},
        {"ranges": np.ones(1), "angle_increment": 0.01},
        {"stamp": 0.0},  # a simulation's begin: messages without a stamp have NaN here
        {"stamp": 1.7e9},
    ],
)
def test_a_scan_that_says_something_is_one(changes: dict[str, object]) -> None:
    assert scan_problem(scan_of(**{"ranges": wall(), **changes})) == ""  # type: ignore[arg-type]


@given(share=st.floats(0.02, 1.0), seed=st.integers(0, 1000))
def test_readings_of_another_unit_are_named_however_many_beams_meet_something(share: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    metres = np.where(rng.random(BEAMS) < share, rng.uniform(0.4, 8.0, BEAMS), math.inf)
    assert scan_problem(scan_of(metres)) == ""
    assert scan_problem(scan_of(metres, range_max=math.inf)) == ""
    assert "metres" in scan_problem(scan_of(metres * 1000.0))
    assert "metres" in scan_problem(scan_of(metres * 1000.0, range_max=math.inf))


def test_the_sentence_is_the_same_for_the_next_scan() -> None:
    rng = np.random.default_rng(0)
    told = {scan_problem(scan_of(wall() * 1000.0 * rng.uniform(0.9, 1.1))) for _ in range(5)}
    assert len(told) == 1


def test_zero_is_no_hit_even_where_the_bounds_let_it_through() -> None:
    assert not scan_of(np.zeros(BEAMS), range_min=0.0).is_hit.any()


@pytest.mark.parametrize("limit", [math.inf, FLOAT32_MAX])
def test_a_scan_without_an_upper_limit_has_a_reach(limit: float) -> None:
    scan = scan_of(wall(), range_max=limit)
    assert scan.reach == 100.0
    assert scan.is_hit.sum() == np.isfinite(scan.ranges).sum()
    assert scan_of(wall()).reach == 12.0
    assert not scan_of(np.full(BEAMS, FLOAT32_MAX), range_max=limit).is_hit.any()


# ---- laid level


def truth(scan: LaserScan, place: Transform) -> np.ndarray:
    """What the beams hit, reckoned in space, seen from above, shape (N, 2)."""
    points = np.column_stack((scan_points(scan), np.zeros(scan.is_hit.sum())))
    return (points @ place.rotation.T + (place.x, place.y, place.z))[:, :2]


@given(
    yaw=st.floats(-4.0, 4.0),
    is_upside_down=st.booleans(),
    is_pitched=st.booleans(),
    start=st.floats(-math.tau, math.tau),
    step=st.sampled_from([math.tau / BEAMS, -math.tau / BEAMS, 0.004]),
    seed=st.integers(0, 99),
)
def test_level_points_are_those_in_space(
    yaw: float, is_upside_down: bool, is_pitched: bool, start: float, step: float, seed: int
) -> None:
    roll, pitch = (0.0, math.pi) if is_pitched and is_upside_down else (math.pi * is_upside_down, 0.0)
    place = mount(roll, pitch, yaw)
    scan = scan_of(np.random.default_rng(seed).uniform(0.1, 13.0, BEAMS), angle_min=start, angle_increment=step)
    level = level_scan(scan, place, "base_link")
    assert level.points == pytest.approx(truth(scan, place), abs=1e-9)
    assert (level.height, level.rises) == (0.2, None)


@given(
    tilt=st.floats(0.01, 0.999 * MAX_TILT),
    way=st.floats(-math.pi, math.pi),
    yaw=st.floats(-4.0, 4.0),
    is_upside_down=st.booleans(),
)
def test_a_slight_tilt_is_projected(tilt: float, way: float, yaw: float, is_upside_down: bool) -> None:
    turned, leant = mount(math.pi * is_upside_down, 0.0, yaw), mount(tilt * math.cos(way), tilt * math.sin(way), 0.0)
    w, v = np.array(leant[3:6]), np.array(turned[3:6])
    q = leant.qw * v + turned.qw * w + np.cross(w, v)
    place = Transform(0.1, -0.05, 0.2, *q.tolist(), leant.qw * turned.qw - float(w @ v))
    scan = scan_of(np.random.default_rng(1).uniform(0.1, 13.0, BEAMS))
    level = level_scan(scan, place, "base_link")
    points, true = level.points - (0.1, -0.05), truth(scan, place) - (0.1, -0.05)
    assert np.hypot(*points.T) == pytest.approx(np.hypot(*true.T), abs=1e-9)
    off = np.hypot(*(points - true).T) / np.hypot(*true.T)
    assert off.max() < tilt * tilt / 3.9 + 1e-6
    assert scan_problem(level.scan) == ""
    assert level.rises is not None
    lengths = level.scan.ranges[level.scan.is_hit]
    hits = np.column_stack((scan_points(scan), np.zeros(scan.is_hit.sum())))
    heights = (hits @ place.rotation.T)[:, 2]
    assert level.rises[level.scan.is_hit] * lengths == pytest.approx(heights, abs=1e-9)


def test_a_tilt_makes_no_hit_of_what_was_none() -> None:
    scan = scan_of([math.nan, math.inf, -math.inf, 0.0, 0.149, 12.05, 13.0, 0.15, 12.0], angle_increment=0.5)
    level = level_scan(scan, mount(0.15, 0.0, 0.3), "base_link").scan
    assert level.is_hit.tolist() == scan.is_hit.tolist() == [False] * 7 + [True] * 2
    assert math.isnan(level.ranges[0])
    assert level.ranges[1] == math.inf


@pytest.mark.parametrize(
    ("roll", "pitch", "degrees"),
    [
        (math.pi / 2, 0.0, 90),
        (0.0, math.pi / 2, 90),
        (0.0, 0.35, 20),
        (math.pi - 0.79, 0.0, 45),
        (0.0, math.pi + 0.2, 11),
    ],
)
def test_a_tilted_laser_is_refused_with_frame_and_angle(roll: float, pitch: float, degrees: int) -> None:
    with pytest.raises(TransformError, match=f"the laser 'laser' is tilted by {degrees} deg in 'base_link'") as caught:
        level_scan(scan_of(wall()), mount(roll, pitch, 1.0), "base_link")
    assert isinstance(caught.value, LaserTilted)


def test_noise_of_a_level_mount_leaves_the_lengths_alone() -> None:
    scan = scan_of(wall())
    level = level_scan(scan, mount(math.pi + 0.004, 0.003, 0.0), "base_link")
    assert level.scan.ranges is scan.ranges
    assert level.scan == replace(scan, angle_min=math.pi, angle_increment=-scan.angle_increment)
