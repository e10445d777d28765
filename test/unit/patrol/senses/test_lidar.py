"""What the patrol makes of the scans that it hears."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from senses_world import Health, LaserFrames

from rosbot_patrol.patrol.records.inputs import ScanView
from rosbot_patrol.patrol.senses.health import OK, WARN
from rosbot_patrol.patrol.senses.lidar import Lidar
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.scan import LaserScan, LevelScan

NOW = 10.0


def made(frames: LaserFrames) -> tuple[Lidar, Health]:
    health = Health()
    return Lidar(InputParams(), frames, health), health


def scan(**changes: Any) -> LaserScan:
    """Something 1 m off on the laser's left."""
    angles = -math.pi + math.tau / 360 * np.arange(360)
    values = {
        "stamp": NOW,
        "frame_id": "laser",
        "angle_min": -math.pi,
        "angle_increment": math.tau / 360,
        "range_min": 0.2,
        "range_max": 12.0,
        "ranges": np.where(np.abs(angles - math.pi / 2) < 0.1, 1.0, math.inf),
    }
    return LaserScan(**{**values, **changes})


def look(lidar: Lidar, heard: LaserScan) -> ScanView | None:
    lidar.hear(heard, NOW)
    return lidar.place(lidar.usable(NOW), NOW)


@pytest.mark.parametrize(
    ("laser", "y"), [((0.0, 0.0, 0.0, 1.0), 3.0), ((1.0, 0.0, 0.0, 0.0), 1.0), ((0.0, 1.0, 0.0, 0.0), 3.0)]
)
def test_a_scan_has_its_place_in_map_however_the_laser_hangs(laser: Any, y: float) -> None:
    lidar, health = made(LaserFrames(laser))
    lidar.hear(scan(), NOW)
    found = lidar.usable(NOW)
    assert found is not None
    assert lidar.usable(NOW) is found
    view = lidar.place(found, NOW)
    assert view is not None
    assert lidar.place(found, NOW) is view
    points = LevelScan(view.scan, view.map_from_laser).points
    assert points.mean(axis=0) == pytest.approx((1.0, y), abs=0.02)
    assert health.parts["lidar"][0] == OK


@pytest.mark.parametrize("changes", [{"ranges": np.zeros(360)}, {"stamp": math.nan}, {"range_max": math.nan}])
def test_a_scan_that_says_nothing_is_as_none_and_is_told(
    changes: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    lidar, health = made(LaserFrames())
    for _ in range(20):
        assert look(lidar, scan(**changes)) is None
    assert health.parts["lidar"][0] == WARN
    assert "is left out" in health.parts["lidar"][1]
    assert len(caplog.records) == 1
    assert look(lidar, scan()) is not None
    assert health.parts["lidar"][0] == OK


def test_what_is_told_of_the_lidar_ends_with_the_mission() -> None:
    lidar, health = made(LaserFrames())
    lidar.hear(scan(ranges=np.zeros(360)), NOW)
    lidar.usable(NOW)
    assert "lidar" in health.parts
    lidar.rest()
    assert "lidar" not in health.parts


def test_a_tilted_laser_is_as_none_and_is_told(caplog: pytest.LogCaptureFixture) -> None:
    lidar, health = made(LaserFrames((0.6, 0.0, 0.0, 0.8)))
    for _ in range(20):
        assert look(lidar, scan()) is None
    assert health.parts["lidar"][0] == WARN
    assert "tilted by 74 deg in 'map'" in health.parts["lidar"][1]
    assert len(caplog.records) == 1


def test_a_tilted_laser_gives_no_clearance_and_ends_nothing() -> None:
    lidar, health = made(LaserFrames((0.6, 0.0, 0.0, 0.8)))
    assert lidar.clearance(scan(), NOW) is None
    assert "tilted by 74 deg in 'base_link'" in health.parts["lidar"][1]


def test_a_place_that_is_not_known_yet_is_no_fault() -> None:
    frames = LaserFrames()
    lidar, health = made(frames)
    frames.is_known = False
    assert look(lidar, scan()) is None
    assert "lidar" not in health.parts


@pytest.mark.parametrize(("later", "stands_in"), [(0.4, True), (0.6, False)])
def test_the_scan_before_stands_in_for_one_that_cannot_be_placed_yet(later: float, stands_in: bool) -> None:
    frames = LaserFrames()
    lidar, _ = made(frames)
    before = look(lidar, scan())
    frames.is_known = False
    assert look(lidar, scan(stamp=NOW + later)) is (before if stands_in else None)


@pytest.mark.parametrize(("at", "is_fresh"), [(11.0, True), (11.1, False), (9.0, True), (8.9, False)])
def test_a_scan_is_good_for_a_while_and_not_after_a_clock_was_set(at: float, is_fresh: bool) -> None:
    lidar, _ = made(LaserFrames())
    lidar.hear(scan(), NOW)
    assert (lidar.usable(at) is not None) == is_fresh


def test_the_clearance_is_to_the_nearest_thing_from_the_robots_centre() -> None:
    lidar, _ = made(LaserFrames())
    assert lidar.clearance(None, NOW) is None
    nothing = scan(ranges=np.full(360, math.inf))
    assert lidar.clearance(nothing, NOW) is None
    assert lidar.clearance(scan(), NOW) == pytest.approx(math.hypot(1.0, 3.0), abs=0.06)
