"""Which of the camera's pictures count."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.patrol_images import is_black


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
