"""Cuts through shapes, and rays against them: exact."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.scene.matrices import from_xyz_rpy
from rosbot_patrol.simulation.scene.scene import Body, Collision, Shape
from rosbot_patrol.simulation.scene.slices import EMPTY, Slice, slice_bodies, slice_shape
from rosbot_patrol.simulation.sensors.lidar import LidarParams, measure_scan
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams, measure_range

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)


def box_room(width: float = 4.0, depth: float = 3.0) -> Slice:
    walls = [
        ((width / 2 + 0.05, 0.0), (0.1, depth)),
        ((-width / 2 - 0.05, 0.0), (0.1, depth)),
        ((0.0, depth / 2 + 0.05), (width + 0.2, 0.1)),
        ((0.0, -depth / 2 - 0.05), (width + 0.2, 0.1)),
    ]
    bodies = [
        Body(
            name=f"wall_{i}",
            kind="wall",
            pose=from_xyz_rpy((*at, 1.0)),
            collisions=(Collision(shape=Shape(kind="box", size=(*size, 2.0))),),
        )
        for i, (at, size) in enumerate(walls)
    ]
    return slice_bodies(bodies, 0.16)


def exact_room(x: float, y: float, bearings: np.ndarray, width: float = 4.0, depth: float = 3.0) -> np.ndarray:
    with np.errstate(divide="ignore"):
        along_x = np.where(np.cos(bearings) > 0, width / 2 - x, width / 2 + x) / np.abs(np.cos(bearings))
        along_y = np.where(np.sin(bearings) > 0, depth / 2 - y, depth / 2 + y) / np.abs(np.sin(bearings))
    return np.minimum(along_x, along_y)


@pytest.mark.parametrize("pose", [Pose2D(0, 0, 0), Pose2D(1.2, -0.7, 2.0), Pose2D(-1.9, 1.4, -3.1)])
def test_a_scan_of_a_box_room_is_exact(pose: Pose2D) -> None:
    scan = measure_scan(LidarParams(range_min=0.0, noise=0.0, resolution=0.0), box_room(), pose, 1.0, None)
    expected = exact_room(pose.x, pose.y, pose.yaw + scan.angles)
    assert scan.ranges.shape == (720,)
    assert np.allclose(scan.ranges, expected, atol=1e-9)


def test_noise_has_the_spread_that_is_configured() -> None:
    params = LidarParams(noise=0.01, resolution=0.0)
    room = box_room()
    exact = measure_scan(params, room, Pose2D(), 0.0, None).ranges
    errors = [measure_scan(params, room, Pose2D(), 0.0, noise_of(1, "lidar", i)).ranges - exact for i in range(50)]
    assert np.std(errors) == pytest.approx(0.01, rel=0.03)
    assert abs(np.mean(errors)) < 2e-4


def test_limits_of_the_lidar() -> None:
    params = LidarParams(noise=0.0, range_min=1.6, range_max=2.2)
    ranges = measure_scan(params, box_room(), Pose2D(), 0.0, None).ranges
    assert np.isneginf(ranges).any()
    assert np.isposinf(ranges).any()
    assert (measure_scan(params, EMPTY, Pose2D(), 0.0, None).ranges == math.inf).all()


def test_a_circle_is_hit_at_its_edge_and_from_within() -> None:
    scene = Slice(np.zeros((0, 4)), np.array([[2.0, 0.0, 0.5]]))
    ranges = scene.cast(0.0, 0.0, 0.0, 0.1, 4, longest=10.0)
    assert ranges[0] == pytest.approx(1.5)
    assert ranges[3] == 10.0
    assert scene.cast(2.0, 0.0, 0.0, 0.1, 5, longest=10.0) == pytest.approx(0.5)


@pytest.mark.parametrize("first", [-math.pi, -0.3, 3.0, 6.0])
def test_beams_wrap_around_wherever_the_fan_begins(first: float) -> None:
    ranges = box_room().cast(0.3, 0.2, first, math.tau / 100, 100, longest=50.0)
    assert np.allclose(ranges, exact_room(0.3, 0.2, first + np.arange(100) * math.tau / 100), atol=1e-9)


def test_cuts_of_shapes() -> None:
    def cut(shape: Shape, height: float, rpy: tuple[float, float, float] = (0, 0, 0)) -> Slice:
        return slice_shape(shape, from_xyz_rpy((1.0, 2.0, 0.0), rpy), height)

    assert len(cut(Shape(kind="box", size=(1, 1, 1)), 0.2).segments) == 4
    assert len(cut(Shape(kind="box", size=(1, 1, 1)), 0.6).segments) == 0
    tilted = cut(Shape(kind="box", size=(1, 1, 1)), 0.0, (math.pi / 4, 0.0, 0.0)).segments
    assert np.abs(tilted[:, (1, 3)] - 2.0).max() == pytest.approx(math.sqrt(0.5))
    assert cut(Shape(kind="sphere", size=(0.5,)), 0.3).circles[0, 2] == pytest.approx(0.4)
    assert cut(Shape(kind="capsule", size=(0.5, 1.0)), 0.8).circles[0, 2] == pytest.approx(0.4)
    assert len(cut(Shape(kind="cylinder", size=(0.5, 1.0)), 0.6).circles) == 0
    lying = cut(Shape(kind="cylinder", size=(0.5, 2.0)), 0.01, (0.0, math.pi / 2, 0.0)).segments
    assert lying[:, 0].max() - lying[:, 0].min() == pytest.approx(2.0)
    mesh = Shape(
        kind="mesh", size=(1, 1, 1), vertices=TETRAHEDRON, faces=np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    )
    assert len(cut(mesh, 0.5).segments) == 3
    assert len(cut(Shape(kind="plane", size=(9, 9)), 0.1).segments) == 0


def test_sight_is_blocked_by_what_lies_between() -> None:
    scene = Slice(np.array([[1.0, -1.0, 1.0, 1.0]]), np.array([[0.0, 3.0, 0.5]]))
    assert scene.is_blocked((0, 0), (2, 0))
    assert not scene.is_blocked((0, 0), (0.9, 0))
    assert not scene.is_blocked((0, 0), (2, 3))
    assert scene.is_blocked((-2, 3), (2, 3))


def test_a_range_sensor_tells_the_nearest_in_its_cone_and_its_limits() -> None:
    params = RangeParams(noise=0.0)
    assert measure_range(params, box_room(), Pose2D(1.5, 0.0, 0.0), None) == pytest.approx(0.5)
    assert measure_range(params, box_room(), Pose2D(0.0, 0.0, 0.0), None) == 0.9
    assert measure_range(params, box_room(), Pose2D(1.995, 0.0, 0.0), None) == 0.01


def test_ranges_are_whole_multiples_of_the_resolution() -> None:
    ranges = measure_scan(LidarParams(noise=0.01, resolution=0.02), box_room(), Pose2D(), 0.0, noise_of(1, "l")).ranges
    assert np.abs(ranges / 0.02 - np.rint(ranges / 0.02)).max() < 1e-9
    assert len(np.unique(ranges)) < 120


def test_a_beam_without_return_is_what_the_driver_makes_of_it() -> None:
    beyond = LidarParams(no_return="beyond", range_max=8.0)
    assert (measure_scan(beyond, EMPTY, Pose2D(), 0.0, noise_of(1, "l")).ranges == 9.0).all()
    assert not measure_scan(beyond, EMPTY, Pose2D(), 0.0, None).is_hit.any()
    lost = LidarParams(dropped=1.0, dropped_as="zero")
    assert (measure_scan(lost, box_room(), Pose2D(), 0.0, noise_of(1, "l")).ranges == 0.0).all()
    assert (measure_scan(LidarParams(dropped=0.0), box_room(), Pose2D(), 0.0, noise_of(1, "l")).is_hit).all()


def test_a_scanner_of_a_part_of_a_turn_and_one_that_hangs_upside_down() -> None:
    pose = Pose2D(0.7, 0.3, 0.4)
    part = LidarParams(samples=270, angle_min=-2.0, angle_max=1.5, noise=0.0, resolution=0.0)
    scan = measure_scan(part, box_room(), pose, 0.0, None, frame="base_scan")
    assert scan.frame_id == "base_scan"
    assert np.allclose(scan.ranges, exact_room(0.7, 0.3, 0.4 + scan.angles), atol=1e-9)
    assert scan.angles[-1] == pytest.approx(1.5)
    hanging = measure_scan(part, box_room(), pose, 0.0, None, flipped=True)
    assert np.allclose(hanging.ranges, exact_room(0.7, 0.3, 0.4 - scan.angles), atol=1e-9)


@pytest.mark.parametrize("flipped", [False, True])
def test_a_sweep_that_takes_time_is_distorted_by_the_motion_within_it(flipped: bool) -> None:
    params = LidarParams(noise=0.0, resolution=0.0, range_min=0.0, sweep_time=0.1)
    twist = Twist2D(0.5, 0.0, 1.0)
    scan = measure_scan(params, box_room(), Pose2D(0.2, 0.1, 0.3), 7.0, None, twist=twist, flipped=flipped)
    assert scan.stamp == pytest.approx(6.9)
    ago = 0.1 * (1.0 - (np.arange(720) + 0.5) / 720)
    yaw = 0.3 - 1.0 * ago
    x, y = 0.2 - 0.5 * ago * np.cos(0.3), 0.1 - 0.5 * ago * np.sin(0.3)
    exact = exact_room(x, y, yaw + (-scan.angles if flipped else scan.angles))
    assert np.abs(scan.ranges - exact).max() < 0.02
    still = measure_scan(params, box_room(), Pose2D(0.2, 0.1, 0.3), 7.0, None, twist=Twist2D())
    assert np.abs(still.ranges - exact).max() > 0.03
