import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from rosbot_patrol.control.collision_guard import CollisionGuard, GuardParams, RangeReading, Verdict
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, compose, invert, transform_points
from rosbot_patrol.scan import LaserScan

BASE_FROM_LASER = Pose2D(0.02, 0.0, math.pi)
AHEAD, BACK, LEFT = Twist2D(0.5), Twist2D(-0.5), Twist2D(0.0, 0.0, 1.0)


def cast(segments, map_from_base, noise=0.0, seed=1):
    """A scan of 720 beams of wall segments, shape (N, 4), by intersecting each beam with each."""
    map_from_laser = compose(map_from_base, BASE_FROM_LASER)
    walls = np.asarray(segments, dtype=float).reshape(-1, 4)
    a = transform_points(invert(map_from_laser), walls[:, :2])
    b = transform_points(invert(map_from_laser), walls[:, 2:])
    angles = -math.pi + np.arange(720) * math.tau / 720
    ranges = np.full(720, math.inf)
    for (ax, ay), (bx, by) in zip(a, b, strict=True):
        dx, dy, ux, uy = bx - ax, by - ay, np.cos(angles), np.sin(angles)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (ax * dy - ay * dx) / (ux * dy - uy * dx)
            at = (ax * uy - ay * ux) / (ux * dy - uy * dx)
        hit = (along > 0.0) & (at >= 0.0) & (at <= 1.0)
        ranges[hit] = np.minimum(ranges[hit], along[hit])
    ranges = ranges + np.random.default_rng(seed).normal(0.0, noise, 720) if noise else ranges
    ranges[ranges < 0.2] = math.inf
    return LaserScan(
        stamp=0.0,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / 720,
        range_min=0.2,
        range_max=12.0,
        ranges=ranges,
    )


def wall_ahead(x):
    return [(x, -2.0, x, 2.0)]


def guard_at(segments, pose=None, noise=0.0, **params):
    guard = CollisionGuard(GuardParams(**params))
    pose = pose or Pose2D()
    guard.see(cast(segments, pose, noise), BASE_FROM_LASER, 0.0, pose)
    return guard


def drive(segments, wish, seconds=20.0, pose=None, noise=0.01):
    """Follow guarded commands ideally at 10 Hz; return the poses."""
    guard, poses = CollisionGuard(GuardParams()), [pose or Pose2D()]
    for step in range(int(seconds * 10)):
        now, pose = step * 0.1, poses[-1]
        guard.see(cast(segments, pose, noise, seed=step), BASE_FROM_LASER, now, pose)
        twist = guard.limit(wish, now, pose).twist
        turned = twist.wz * 0.05  # drive along the chord
        half = Pose2D(pose.x, pose.y, pose.yaw + turned)
        poses.append(compose(half, Pose2D(twist.vx * 0.1, twist.vy * 0.1, turned)))
    return poses


def clearance(pose, segments):
    """Distance of walls from the true body (0.20 x 0.235 m), sampled."""
    points = np.vstack([np.linspace(s[:2], s[2:], 400) for s in segments])
    local = transform_points(invert(pose), points)
    out = np.maximum(np.abs(local) - np.array([0.10, 0.1175]), -1.0)
    return float(np.where((out > 0).any(axis=1), np.hypot(*np.maximum(out, 0.0).T), out.max(axis=1)).min())


def test_open_space_is_not_limited():
    verdict = guard_at(wall_ahead(3.0)).limit(AHEAD, 0.1)
    assert verdict == Verdict(AHEAD, 1.0)


def test_slows_then_stops_ahead_of_a_wall():
    scales = [guard_at(wall_ahead(x), gap=0.1).limit(AHEAD, 0.0).scale for x in (0.8, 0.4, 0.3, 0.222)]
    assert scales[0] == 1.0
    assert sorted(scales, reverse=True) == scales
    assert scales[-1] == 0.0
    assert guard_at(wall_ahead(0.222), gap=0.1).limit(AHEAD, 0.0).reason == "something is in the way"


@pytest.mark.parametrize("speed", [0.1, 0.3, 1.0])
def test_never_touches_and_comes_close(speed):
    walls = wall_ahead(1.5)
    poses = drive(walls, Twist2D(speed))
    gaps = [clearance(pose, walls) for pose in poses]
    assert 0.03 < min(gaps) < 0.12


def test_can_leave_a_wall_that_it_stands_at():
    guard = guard_at(wall_ahead(0.16), pose=Pose2D(-0.1, 0.0, 0.0))  # seen from farther off
    here = Pose2D(0.02, 0.0, 0.0)
    guard.see(cast(wall_ahead(0.16), here), BASE_FROM_LASER, 0.1, here)
    assert guard.limit(AHEAD, 0.1, here).twist == STOP
    assert guard.limit(BACK, 0.1, here).scale == 1.0


def test_remembers_what_lies_in_the_blind_ring_and_forgets_it_in_time():
    guard = guard_at(wall_ahead(0.30))
    near = Pose2D(0.14, 0.0, 0.0)  # the wall ahead is 0.14 m from the lidar
    for now in (0.1, 10.0):
        guard.see(cast([(5.0, -1.0, 5.0, 1.0)], near), BASE_FROM_LASER, now, near)
        assert guard.limit(AHEAD, now, near).twist == STOP
    guard.see(cast([(5.0, -1.0, 5.0, 1.0)], near), BASE_FROM_LASER, 21.0, near)
    assert guard.limit(AHEAD, 21.0, near).scale == 1.0


@pytest.mark.parametrize("offset", [0.0, 0.1, -0.1])
def test_passes_a_door_of_90_cm(offset):
    door = [(1.0, 0.45, 1.0, 3.0), (1.0, -3.0, 1.0, -0.45), (1.15, 0.45, 1.15, 3.0), (1.15, -3.0, 1.15, -0.45)]
    poses = drive(door, Twist2D(0.4), seconds=6.0, pose=Pose2D(0.0, offset, 0.0))
    assert poses[-1].x > 2.3


@pytest.mark.parametrize("wz", [1.0, -0.75])
def test_turns_in_place_20_cm_from_a_wall(wz):
    walls = wall_ahead(0.2)
    poses = drive(walls, Twist2D(0.0, 0.0, wz), seconds=9.0)
    turned = sum(math.remainder(b.yaw - a.yaw, math.tau) for a, b in itertools.pairwise(poses))
    assert abs(turned) > 0.9 * abs(wz) * 9.0


def test_drives_along_a_wall_20_cm_beside_it():
    walls = [(-5.0, 0.2, 8.0, 0.2)]
    assert drive(walls, Twist2D(0.4), seconds=6.0)[-1].x > 2.2


def test_arc_that_sweeps_into_a_wall_is_turned_out_of():
    verdict = guard_at(wall_ahead(0.225), gap=0.1).limit(Twist2D(0.3, 0.0, 0.8), 0.0)
    assert verdict.twist.vx == 0.0
    assert verdict.twist.wz > 0.0
    assert verdict.reason == "something is in the way, turning only"


def test_what_lies_behind_does_not_hinder_driving_ahead():
    assert guard_at(wall_ahead(-0.25)).limit(AHEAD, 0.0).scale == 1.0
    assert guard_at(wall_ahead(-0.25)).limit(BACK, 0.0).scale < 0.5


def test_one_stray_beam_is_no_obstacle_and_two_are():
    for count, scale in ((1, 1.0), (3, 0.0)):
        scan = cast([(9.0, -1.0, 9.0, 1.0)], Pose2D())
        scan.ranges[:count] = 0.2  # angle -pi of the laser, which looks backwards: ahead
        guard = CollisionGuard(GuardParams(gap=0.12))
        guard.see(scan, BASE_FROM_LASER, 0.0)
        assert guard.limit(AHEAD, 0.0).scale == scale


def test_without_a_fresh_scan_it_creeps_and_says_so():
    guard = CollisionGuard(GuardParams())
    verdict = guard.limit(AHEAD, 0.0)
    assert verdict.twist.vx == pytest.approx(0.1)
    assert verdict.reason == "no scan yet"
    guard = guard_at(wall_ahead(3.0))
    assert "the last scan is 2.0 s old" in guard.limit(AHEAD, 2.0).reason
    assert guard.limit(LEFT, 2.0).twist.wz == pytest.approx(0.4)
    assert guard.limit(STOP, 2.0) == Verdict(STOP, 1.0)
    assert guard.limit(AHEAD, -5.0).scale < 1.0  # the clock went back


def test_a_scan_that_comes_while_a_command_is_looked_at_is_fresh():
    guard = CollisionGuard(GuardParams())
    guard.see(cast(wall_ahead(3.0), Pose2D()), BASE_FROM_LASER, 10.02)
    assert guard.limit(AHEAD, 10.0).scale == 1.0


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"ranges": np.zeros(720)}, "say nothing"),
        ({"ranges": np.full(720, math.nan)}, "say nothing"),
        ({"range_max": 0.0}, "range_max 0"),
        ({"angle_increment": 0.0}, "angle_increment is 0"),
        ({"ranges": cast(wall_ahead(0.25), Pose2D()).ranges * 1000.0}, "millimetres"),
        ({"ranges": cast(wall_ahead(0.25), Pose2D()).ranges * 1000.0, "range_max": 12000.0}, "millimetres"),
    ],
)
def test_a_scan_that_says_nothing_is_no_scan(changes, named):
    good, guard = cast([*wall_ahead(0.225), *wall_ahead(-3.0)], Pose2D()), CollisionGuard(GuardParams())
    bad = replace(good, **changes)
    guard.see(bad, BASE_FROM_LASER, 0.0, Pose2D())
    verdict = guard.limit(Twist2D(0.3), 0.0, Pose2D())
    assert verdict.twist.vx == pytest.approx(0.1)
    assert "no usable scan yet" in verdict.reason
    assert named in verdict.reason
    guard.see(good, BASE_FROM_LASER, 1.0, Pose2D())
    seen = guard.limit(Twist2D(0.3), 1.0, Pose2D())
    assert seen.scale < 0.9
    assert "on the way" in seen.reason
    guard.see(bad, BASE_FROM_LASER, 1.1, Pose2D())
    assert guard.limit(Twist2D(0.3), 1.1, Pose2D()) == seen  # what was seen is not forgotten for it
    assert "the last usable scan is 0.7 s old" in guard.limit(Twist2D(0.3), 1.7, Pose2D()).reason
    guard.see(good, BASE_FROM_LASER, 1.8, Pose2D())
    assert (guard.problem, guard.blind(1.8)) == ("", "")


def test_a_scan_that_was_refused_for_its_mount_is_none_either():
    guard = CollisionGuard(GuardParams())
    guard.refuse("the laser 'laser' is tilted by 30 deg")
    assert guard.limit(LEFT, 0.0).twist.wz == pytest.approx(0.4)
    assert "tilted by 30 deg" in guard.limit(LEFT, 0.0).reason


def test_a_large_hall_is_free():
    guard = CollisionGuard(GuardParams())
    guard.see(replace(cast([], Pose2D()), ranges=np.full(720, math.inf)), BASE_FROM_LASER, 0.0)
    assert guard.limit(AHEAD, 0.0) == Verdict(AHEAD, 1.0)


@pytest.mark.parametrize("limit", [math.inf, 3.4028234663852886e38])
def test_a_scan_without_an_upper_limit_is_seen(limit):
    guard = CollisionGuard(GuardParams())
    guard.see(replace(cast(wall_ahead(0.3), Pose2D()), range_max=limit), BASE_FROM_LASER, 0.0)
    assert guard.limit(AHEAD, 0.0).scale < 0.8


def test_moves_between_scans_are_accounted_for():
    guard = guard_at(wall_ahead(0.5))
    assert guard.limit(AHEAD, 0.2, Pose2D(0.3, 0.0, 0.0)).scale < guard.limit(AHEAD, 0.2, Pose2D()).scale


# ---- range sensors near the floor

FRONT_LEFT = Pose2D(0.1, 0.05, 0.13)
REAR_LEFT = Pose2D(-0.1, 0.05, 3.01)


def hear(guard, distance, *, times=2, now=0.0, pose=None, sensor=FRONT_LEFT, name="fl"):
    """So many readings at 5 Hz, the last of them at `now`."""
    for k in range(times):
        reading = RangeReading(distance, 0.01, 0.9, sensor)
        guard.see_range(name, reading, now - 0.2 * (times - 1 - k), pose or Pose2D())


def test_a_low_thing_that_only_a_range_sensor_sees_stops_the_robot():
    guard = guard_at(wall_ahead(5.0))
    hear(guard, 0.06)
    verdict = guard.limit(AHEAD, 0.1, Pose2D())
    assert verdict.twist == STOP
    assert "in the way" in verdict.reason
    assert guard.limit(BACK, 0.1, Pose2D()).scale == 1.0
    hear(guard, 0.2)
    assert 0.05 < guard.limit(AHEAD, 0.1, Pose2D()).scale < 1.0


def test_one_reading_alone_is_not_believed():
    guard = guard_at(wall_ahead(5.0))
    hear(guard, 0.06, times=1)
    assert guard.limit(AHEAD, 0.1, Pose2D()).scale == 1.0
    hear(guard, 0.6, times=1, now=0.2)  # of another thing
    assert guard.limit(Twist2D(0.2), 0.2, Pose2D()).scale == 1.0


def test_readings_of_one_thing_while_the_robot_drives_agree():
    guard = guard_at(wall_ahead(5.0))
    for k in range(3):
        pose = Pose2D(0.1 * k)
        guard.see_range("fl", RangeReading(0.35 - 0.1 * k, 0.01, 0.9, FRONT_LEFT), 0.2 * k, pose)
    assert guard.limit(AHEAD, 0.4, Pose2D(0.2)).scale < 0.5


def test_the_end_of_the_range_and_nan_are_no_obstacles():
    guard = guard_at(wall_ahead(5.0))
    for nothing in (0.9, math.inf, math.nan):
        hear(guard, nothing)
    assert guard.limit(AHEAD, 0.1, Pose2D()) == Verdict(AHEAD, 1.0)


def test_too_near_to_measure_is_near():
    guard = guard_at(wall_ahead(5.0))
    hear(guard, -math.inf)
    assert guard.limit(AHEAD, 0.1, Pose2D()).twist.vx == 0.0


@pytest.mark.parametrize("broken", [-1.0, -0.001, -8190.0, math.nan])
def test_the_negative_reading_of_a_broken_range_sensor_says_nothing(broken):
    guard = guard_at(wall_ahead(5.0))
    hear(guard, broken, times=20)
    assert guard.limit(AHEAD, 0.1, Pose2D()) == Verdict(AHEAD, 1.0)
    hear(guard, 0.06, now=0.2)
    hear(guard, broken, now=0.4)  # does not clear what it met before
    assert guard.limit(AHEAD, 0.5, Pose2D()).twist == STOP


def test_a_sensor_that_only_tells_nearer_or_not():
    for said, scale in ((-math.inf, 0.0), (math.inf, 1.0), (-1.0, 1.0)):
        guard = guard_at(wall_ahead(5.0))
        for k in range(2):
            guard.see_range("fl", RangeReading(said, 0.06, 0.06, FRONT_LEFT), 0.2 * k, Pose2D())
        assert guard.limit(AHEAD, 0.3, Pose2D()).scale == scale


def test_behind_counts_for_driving_back():
    guard = guard_at(wall_ahead(5.0))
    hear(guard, 0.05, sensor=REAR_LEFT, name="rl")
    assert guard.limit(BACK, 0.1, Pose2D()).twist.vx == 0.0
    assert guard.limit(AHEAD, 0.1, Pose2D()).scale == 1.0


def test_what_a_range_sensor_met_is_remembered_while_the_robot_turns_for_a_while():
    guard = guard_at(wall_ahead(5.0), stale_after=20.0)
    hear(guard, 0.06)
    turned = Pose2D(0.0, 0.0, 0.25)
    hear(guard, 0.9, now=0.5, pose=turned)  # looks beside it now
    assert guard.limit(AHEAD, 0.6, turned).twist.vx == 0.0
    assert guard.limit(AHEAD, 4.0, turned).scale == 1.0


def test_what_has_gone_is_free_at_once():
    guard = guard_at(wall_ahead(5.0))
    hear(guard, 0.06)
    hear(guard, 0.9, times=1, now=0.2)
    assert guard.limit(AHEAD, 0.3, Pose2D()).scale == 1.0


def test_the_robot_stops_before_a_low_thing():
    """Driven at 10 Hz towards an edge 0.4 m ahead of the front sensors that the lidar does not see."""
    guard, pose, edge = CollisionGuard(GuardParams()), Pose2D(), 0.5
    for step in range(60):
        now = 0.1 * step
        guard.see(cast(wall_ahead(5.0), pose), BASE_FROM_LASER, now, pose)
        if step % 2 == 0:
            ahead = (edge - pose.x - FRONT_LEFT.x) / math.cos(FRONT_LEFT.yaw)
            guard.see_range("fl", RangeReading(ahead, 0.01, 0.9, FRONT_LEFT), now, pose)
        twist = guard.limit(Twist2D(0.4), now, pose).twist
        pose = Pose2D(pose.x + twist.vx * 0.1)
    assert 0.02 < edge - pose.x - 0.12 < 0.12


@pytest.mark.parametrize("lengths", ["cloth", "cloth and a slit", "posts in a hall"])
def test_a_lidar_that_sees_only_the_robot_itself_is_covered(lengths):
    scan = replace(cast([], Pose2D()), range_min=0.02, ranges=np.full(720, 0.03))
    if lengths == "cloth and a slit":
        scan.ranges[10:60] = math.inf
    if lengths == "posts in a hall":
        scan.ranges[10:700] = math.inf
    guard = CollisionGuard(GuardParams())
    guard.see(scan, BASE_FROM_LASER, 0.0, Pose2D())
    verdict = guard.limit(AHEAD, 0.1, Pose2D())
    if lengths == "posts in a hall":
        assert verdict.scale == 1.0
    else:
        assert verdict.twist.vx == pytest.approx(GuardParams().stale_speed)
        assert "is the lidar covered?" in verdict.reason
