"""What the camera makes of a renderer's pictures: noise, exposure, motion blur, limits of the depth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sensors import picture_kernels as kernels
from rosbot_patrol.simulation.sensors.camera import Camera, CameraParams, poses_before

SMALL = {"width": 64, "height": 48}


class Painter:
    """Draws a picture of one grey, brighter the farther along x the camera is, and a depth of 2 m."""

    def __init__(self, grey: float = 100.0, depth: float = 2.0) -> None:
        self.grey, self.depth, self.renders = grey, depth, 0

    def add(self, body: Body) -> None:
        pass

    def close(self) -> None:
        pass

    def render(self, pose: np.ndarray, view: Any) -> tuple[np.ndarray, np.ndarray]:
        self.renders += 1
        shape = (view.height, view.width)
        grey = np.full((*shape, 3), self.grey + 100.0 * pose[0, 3]).clip(0, 255).astype(np.uint8)
        return grey, np.full(shape, self.depth, np.float32)


def camera(painter: Painter, **params: Any) -> Camera:
    return Camera(CameraParams(**SMALL, **params), lambda: painter, ())  # type: ignore[arg-type, return-value]


def at(x: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def test_colour_noise_has_its_spread_stays_in_bounds_and_belongs_to_its_picture() -> None:
    taken = [camera(Painter(), noise=5.0).take(at(0), (), i).colour.astype(int) for i in (7, 7, 8, 15)]
    assert taken[0].std() == pytest.approx(5.0, rel=0.05)
    assert taken[0].mean() == pytest.approx(100.0, abs=0.2)
    assert np.array_equal(taken[0], taken[1])
    assert not np.array_equal(taken[0], taken[2])
    assert not np.array_equal(taken[0], taken[3])  # the same bank, rolled
    assert camera(Painter(254.0), noise=20.0).take(at(0), (), 1).colour.max() == 255
    assert camera(Painter(1.0), noise=20.0).take(at(0), (), 1).colour.min() == 0


def test_without_noise_the_picture_is_as_drawn() -> None:
    assert (camera(Painter(), noise=0.0).take(at(0), (), 3).colour == 100).all()


def test_exposure_is_a_gain_and_the_automatic_one_finds_it() -> None:
    assert (camera(Painter(), noise=0.0, exposure=1.5).take(at(0), (), 0).colour == 150).all()
    assert (camera(Painter(200.0), noise=0.0, exposure=2.0).take(at(0), (), 0).colour == 255).all()
    for grey in (60.0, 115.0, 230.0):
        taken = camera(Painter(grey), noise=0.0, auto_exposure=True).take(at(0), (), 0).colour
        assert taken.mean() == pytest.approx(115.0, abs=1.0)
    dark = camera(Painter(4.0), noise=0.0, auto_exposure=True).take(at(0), (), 0).colour
    assert (dark == 10).all()  # the gain has a limit


def test_depth_has_limits_and_none_outside() -> None:
    for depth, is_seen in ((0.39, False), (0.41, True), (4.99, True), (5.01, False), (math.inf, False)):
        taken = camera(Painter(depth=depth), depth_noise=0.0).take(at(0), (), 0).depth
        assert np.isfinite(taken).all() == is_seen
        assert np.isnan(taken).all() != is_seen
        if is_seen:
            assert (taken == np.float32(depth)).all()


def test_blur_is_the_mean_of_where_the_camera_was_while_the_shutter_was_open() -> None:
    painter = Painter()
    picture = camera(painter, noise=0.0).take(at(0.8), (), 0, earlier=[at(0.2), at(0.4), at(0.6)])
    assert painter.renders == 4
    assert (picture.colour == 150).all()
    painter.renders = 0
    camera(painter).take(at(0.8), (), 0, colour=False, earlier=[at(0.2)])
    assert painter.renders == 1  # depth alone is not blurred


def test_poses_before_lie_on_the_way_that_was_driven() -> None:
    assert poses_before(Pose2D(1.0, 0.0, 0.0), Twist2D(), 0.05) == []
    assert poses_before(Pose2D(1.0, 0.0, 0.0), Twist2D(1.0, 0.0, 0.0), 0.0) == []
    poses = poses_before(Pose2D(0.0, 0.0, math.pi / 2), Twist2D(0.4, 0.0, 0.2), 0.04)
    assert [p.y for p in poses] == pytest.approx([-0.012, -0.008, -0.004])
    assert [p.yaw - math.pi / 2 for p in poses] == pytest.approx([-0.006, -0.004, -0.002])
    fast = poses_before(Pose2D(), Twist2D(0.0, 0.0, 1.2), 0.05)
    assert np.diff([p.yaw for p in fast]) == pytest.approx([0.006] * 8)


def test_depth_of_the_clip_planes() -> None:
    raw = np.array([0.0, 0.5, 1.0], np.float32)
    metres = np.empty(3, np.float32)
    kernels.depth_from_clip(raw, 0.1, 100.0, metres)
    assert metres[:2] == pytest.approx([0.1, 0.1998], rel=1e-3)
    assert np.isinf(metres[2])
