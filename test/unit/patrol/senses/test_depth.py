"""When depth is wanted, what silence means, and which depth picture belongs to a moment."""

from __future__ import annotations

import numpy as np
import pytest
from senses_world import Health

from rosbot_patrol.patrol.intruder.measure import Lens
from rosbot_patrol.patrol.senses.depth import KEPT, DepthRing
from rosbot_patrol.patrol.senses.health import OK, WARN
from rosbot_patrol.patrol.senses.records import ImageRecord, LensRecord

COLOUR = Lens(fx=500.0, fy=500.0, cx=320.0, cy=240.0, width=640, height=480)


def picture(stamp: float, pixels: np.ndarray | None = None, encoding: str = "16UC1") -> ImageRecord:
    data = np.full((3, 4), 1500, np.uint16) if pixels is None else pixels
    return ImageRecord(stamp, 3, 4, encoding, False, 4 * data.itemsize, data.tobytes())


def ring(topic: str = "/depth") -> tuple[DepthRing, Health]:
    health = Health()
    return DepthRing(topic, health), health


def wanted() -> tuple[DepthRing, Health]:
    made, health = ring()
    made.want(0.0)
    assert made.is_on
    return made, health


def test_nothing_is_kept_before_somebody_wants_it_nor_without_a_topic() -> None:
    made, _ = ring()
    made.hear(picture(1.0))
    assert not made.is_on
    assert made.find(1.0, COLOUR) is None
    without, _ = ring("")
    without.want(0.0)
    assert not without.is_on
    assert not without.may_come(1.0)
    assert not without.is_flowing(1.0)


@pytest.mark.parametrize(("has_publisher", "silent_after"), [(False, 1.0), (True, 3.0)])
def test_a_silent_camera_is_told_and_not_asked_again_for_a_minute(
    has_publisher: bool, silent_after: float, caplog: pytest.LogCaptureFixture
) -> None:
    made, health = wanted()
    made.tend(silent_after, is_over=False, has_publisher=has_publisher)
    assert made.is_on
    made.tend(silent_after + 0.1, is_over=False, has_publisher=has_publisher)
    assert not made.is_on
    assert health.parts["depth"] == (WARN, "nothing comes on /depth")
    assert "/depth: no depth comes" in caplog.text
    made.want(silent_after + 60.0)
    assert not made.is_on
    made.want(silent_after + 60.2)
    assert made.is_on


@pytest.mark.parametrize(("at", "is_over", "is_on"), [(8.0, False, True), (8.1, False, False), (1.0, True, False)])
def test_depth_is_let_go_after_the_last_box_and_with_the_mission(at: float, is_over: bool, is_on: bool) -> None:
    made, _ = wanted()
    made.hear(picture(100.0))
    made.tend(at, is_over=is_over, has_publisher=True)
    assert made.is_on == is_on
    assert (made.find(100.0, COLOUR) is not None) == is_on


def test_depth_may_come_until_a_later_picture_is_there() -> None:
    made, _ = wanted()
    assert made.may_come(100.0)
    made.hear(picture(99.9))
    assert made.may_come(100.0)
    made.hear(picture(100.1))
    assert not made.may_come(100.0)


def test_depth_that_has_stopped_is_not_flowing() -> None:
    made, _ = wanted()
    assert made.is_flowing(100.0)
    made.hear(picture(100.0))
    assert made.is_flowing(102.9)
    assert not made.is_flowing(103.1)


@pytest.mark.parametrize(("stamp", "is_found"), [(100.05, True), (99.95, True), (100.07, False)])
def test_a_picture_of_the_same_moment_is_found(stamp: float, is_found: bool) -> None:
    made, health = wanted()
    made.hear(picture(99.0))
    made.hear(picture(100.0))
    assert (made.find(stamp, COLOUR) is not None) == is_found
    assert ("depth" in health.parts) == is_found


def test_only_the_newest_are_kept() -> None:
    made, _ = wanted()
    for stamp in range(KEPT + 1):
        made.hear(picture(float(stamp)))
    assert made.find(0.0, COLOUR) is None
    assert made.find(1.0, COLOUR) is not None


def test_millimetres_become_metres_and_nothing_is_not_known() -> None:
    made, _ = wanted()
    pixels = np.full((3, 4), 1500, np.uint16)
    pixels[0, 0] = 0
    made.hear(picture(1.0, pixels))
    found = made.find(1.0, COLOUR)
    assert found is not None
    assert np.isnan(found.metres[0, 0])
    assert found.metres[1:] == pytest.approx(np.full((2, 4), 1.5), abs=1e-6)
    assert (found.lens.fx, found.lens.width, found.lens.height) == (500.0, 4, 3)  # of the colour camera


def test_metres_stay_and_the_depth_cameras_own_lens_counts() -> None:
    made, health = wanted()
    own = Lens(fx=5.0, fy=5.0, cx=2.0, cy=1.5, width=4, height=3)
    made.hear_lens(LensRecord("depth", own))
    made.hear_lens(LensRecord("depth", COLOUR))
    made.hear(picture(1.0, np.full((3, 4), 2.5, np.float32), "32FC1"))
    found = made.find(1.0, COLOUR)
    assert found is not None
    assert found.metres.tolist() == [[2.5] * 4] * 3
    assert found.lens == own
    assert health.parts["depth"][0] == OK


def test_pictures_that_are_no_depth_are_told_once(caplog: pytest.LogCaptureFixture) -> None:
    made, _ = wanted()
    made.hear(picture(1.0, np.zeros((3, 4), np.uint8), "mono8"))
    for _ in range(3):
        assert made.find(1.0, COLOUR) is None
    assert [record.getMessage() for record in caplog.records] == [
        "/depth: pictures are mono8, expected depth as 32FC1 or 16UC1"
    ]
