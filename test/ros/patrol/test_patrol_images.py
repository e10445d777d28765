"""Which of the camera's pictures count."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

import rospy
from sensor_msgs.msg import Image

from rosbot_patrol.ros.patrol import pictures as patrol_images
from rosbot_patrol.ros.patrol.pictures import PictureRing, is_black, mean_of


@pytest.mark.parametrize("shape", [(480, 640, 3), (240, 320), (1, 1)])
def test_a_black_picture_with_a_little_noise_shows_nothing(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    assert is_black(np.zeros(shape, np.uint8).tobytes())
    assert is_black(rng.integers(0, 8, shape, dtype=np.uint8).tobytes())
    assert is_black(b"")


def test_a_dark_room_with_a_lamp_in_it_shows_something() -> None:
    picture = np.zeros((480, 640, 3), np.uint8)
    picture[100:140, 300:340] = 90
    assert not is_black(picture.tobytes())


def test_a_camera_that_hangs_shows_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    stores = []

    def subscribe(topic, kind, store, **options):
        stores.append(store)
        return SimpleNamespace(unregister=lambda: None)

    monkeypatch.setattr(rospy, "Subscriber", subscribe)
    monkeypatch.setattr(patrol_images, "now", lambda: 1.0)
    ring = PictureRing("/camera")
    assert not ring.is_same(None)
    ring.start()
    for stamp, level in ((1, 10), (2, 20), (3, 20), (4, 20), (6, 30), (7, 40)):
        picture = Image(width=2, height=1, encoding="mono8", step=2, data=bytes([level, level]))
        picture.header.stamp = rospy.Time(stamp)
        stores[0](picture)
        if stamp == 4:
            assert ring.is_same(5.0)  # what comes after it, before its own picture is here
            assert ring.is_same(None)
    assert [stamp for stamp in range(1, 9) if ring.is_same(float(stamp))] == [3, 4]
    assert not ring.is_same(None)
    ring.stop()
    assert not ring.is_same(3.0)


def test_the_mean_of_a_picture_is_of_all_of_it() -> None:
    half = np.zeros((480, 640, 3), np.uint8)
    half[:240] = 200
    assert mean_of(half.tobytes()) == pytest.approx(100.0, abs=3.0)
    assert mean_of(b"") == 0.0
