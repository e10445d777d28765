"""What the camera makes of a renderer's pictures: shutter, exposure, noise, compression, limits of the depth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rosbot_patrol.simulation.scene.scene import Body
from rosbot_patrol.simulation.sensors import picture_kernels as kernels
from rosbot_patrol.simulation.sensors.camera import Camera, CameraParams

SMALL = {"width": 64, "height": 48}
IDEAL = {"noise": 0.0, "auto_exposure": False, "jpeg_quality": 0}


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
    return Camera(CameraParams(**SMALL, **(IDEAL | params)), lambda: painter, ())  # type: ignore[arg-type, return-value]


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
    assert (camera(Painter()).take(at(0), (), 3).colour == 100).all()


def test_exposure_is_a_gain_and_the_automatic_one_finds_it() -> None:
    assert (camera(Painter(), exposure=1.5).take(at(0), (), 0).colour == 150).all()
    assert (camera(Painter(200.0), exposure=2.0).take(at(0), (), 0).colour == 255).all()
    for grey in (60.0, 115.0, 230.0):
        taken = camera(Painter(grey), auto_exposure=True).take(at(0), (), 0).colour
        assert taken.mean() == pytest.approx(115.0, abs=1.0)
    dark = camera(Painter(4.0), auto_exposure=True).take(at(0), (), 0).colour
    assert (dark == 10).all()  # the gain has a limit


def test_depth_has_limits_and_none_outside() -> None:
    for depth, is_seen in ((0.39, False), (0.41, True), (4.99, True), (5.01, False), (math.inf, False)):
        taken = camera(Painter(depth=depth), depth_noise=0.0).take(at(0), (), 0).depth
        assert np.isfinite(taken).all() == is_seen
        assert np.isnan(taken).all() != is_seen
        if is_seen:
            assert (taken == np.float32(depth)).all()


class Stripes(Painter):
    """Draws one white column, 8 px wide, in the middle of a black picture."""

    def render(self, pose: np.ndarray, view: Any) -> tuple[np.ndarray, np.ndarray]:
        colour, depth = super().render(pose, view)
        colour[:] = 0
        colour[:, 28:36] = 240
        return colour, depth


def middle_and_width(row: np.ndarray) -> tuple[float, int]:
    weights = row[:, 0].astype(float)
    return float((weights * np.arange(len(weights))).sum() / weights.sum()), int((weights > 0).sum())


def test_a_rolling_shutter_slants_what_a_turn_shows() -> None:
    taken = camera(Stripes(), blur=0.0, readout=0.05).take(at(0), (), 0, turning=2.0).colour
    top, middle, bottom = (middle_and_width(taken[row])[0] for row in (0, 24, 47))
    focal = CameraParams(**SMALL).intrinsics.fx
    assert bottom - top == pytest.approx(2.0 * 0.05 * focal, rel=0.05)  # later rows saw it farther right
    assert middle == pytest.approx(31.5, abs=0.2)
    still = camera(Stripes(), blur=0.0, readout=0.05).take(at(0), (), 0).colour
    assert np.array_equal(still, Stripes().render(at(0), CameraParams(**SMALL))[0])


def test_a_turn_smears_over_the_exposure_and_keeps_the_light() -> None:
    focal = CameraParams(**SMALL).intrinsics.fx
    for turning in (2.0, -2.0):
        taken = camera(Stripes(), blur=0.1, readout=0.0).take(at(0), (), 0, turning=turning).colour
        middle, width = middle_and_width(taken[10])
        assert middle == pytest.approx(31.5, abs=0.2)
        assert width == pytest.approx(8 + 0.2 * focal, abs=2)
        assert taken[10, :, 0].sum() == pytest.approx(8 * 240, rel=0.02)
    depth_only = camera(Stripes(), blur=0.1).take(at(0), (), 0, turning=2.0, colour=False).colour
    assert middle_and_width(depth_only[10])[1] == 8


def test_a_grey_wall_stays_grey_while_turning() -> None:
    taken = camera(Painter(77.0), blur=0.05, readout=0.05).take(at(0), (), 0, turning=3.0).colour
    assert (taken == 77).all()


def test_the_automatic_exposure_settles() -> None:
    eye = camera(Painter(60.0), auto_exposure=True, settling=0.3)
    bright = [
        eye.take(at(x), (), 0, now=now).colour.mean() for x, now in ((0.0, 0.0), (1.0, 0.1), (1.0, 0.4), (1.0, 3.0))
    ]
    assert bright[0] == pytest.approx(115.0, abs=1.0)  # the first one is exposed as wanted
    assert bright[1] > bright[2] > bright[3]  # a lamp went on
    assert bright[1] > 200.0
    assert bright[3] == pytest.approx(115.0, abs=1.0)
    assert eye.take(at(0.0), (), 0, now=1.0).colour.mean() == pytest.approx(115.0, abs=1.0)  # the clock was set back


def test_compression_loses_little_and_is_the_same_each_time() -> None:
    plain = camera(Painter(), noise=5.0).take(at(0), (), 1).colour.astype(int)
    first, second = (camera(Painter(), noise=5.0, jpeg_quality=80).take(at(0), (), 1).colour for _ in range(2))
    assert np.array_equal(first, second)
    assert 0.5 < np.abs(first - plain).mean() < 5.0


def test_depth_of_the_clip_planes() -> None:
    raw = np.array([0.0, 0.5, 1.0], np.float32)
    metres = np.empty(3, np.float32)
    kernels.depth_from_clip(raw, 0.1, 100.0, metres)
    assert metres[:2] == pytest.approx([0.1, 0.1998], rel=1e-3)
    assert np.isinf(metres[2])
