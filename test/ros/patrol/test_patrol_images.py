"""Which of the camera's pictures count."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

import rospy
from sensor_msgs.msg import Image

from rosbot_patrol.alerts.pictures.ring import EvidenceParams
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


@pytest.fixture
def stores(monkeypatch: pytest.MonkeyPatch) -> list[Callable[[Image], None]]:
    """Filled with what a ring that is started does with a picture."""
    found: list[Callable[[Image], None]] = []

    def subscribe(topic: str, kind: type, store: Callable[[Image], None], **options: object) -> SimpleNamespace:
        found.append(store)
        return SimpleNamespace(unregister=lambda: None)

    monkeypatch.setattr(rospy, "Subscriber", subscribe)
    monkeypatch.setattr(patrol_images, "now", lambda: 1.0)
    return found


def picture_of(stamp: float, level: int) -> Image:
    picture = Image(width=2, height=1, encoding="mono8", step=2, data=bytes([level, level]))
    picture.header.stamp = rospy.Time.from_sec(stamp)
    return picture


def test_a_picture_that_shows_somebody_is_kept_until_it_is_known_who_it_is(stores) -> None:
    ring = PictureRing("/camera", EvidenceParams(evidence_before=1.0))
    ring.start()
    for stamp in range(100, 130):
        stores[0](picture_of(stamp, stamp))
        if stamp == 105:
            ring.keep([105.0])
        if stamp == 110:
            ring.keep([110.0, 105.0, 90.0])  # of 90 there is none
    assert ring.find(105.0).data == bytes([105, 105])
    assert ring.find(104.0, tolerance=2.0).stamp == 105.0
    assert ring.find(120.0) is None
    assert ring.find(129.0).stamp == 129.0
    ring.keep([110.0])
    assert ring.find(105.0) is None
    assert ring.find(110.0).stamp == 110.0
    ring.stop()
    assert ring.find(110.0) is None


def test_a_camera_that_hangs_shows_the_same_picture(stores) -> None:
    ring = PictureRing("/camera")
    assert not ring.is_same(None)
    ring.start()
    for stamp, level in ((1, 10), (2, 20), (3, 20), (4, 20), (6, 30), (7, 40)):
        stores[0](picture_of(stamp, level))
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
