"""Scans that wait for the odometry (the order under a late tf: test/ros/runtime/test_scan_queue.py)."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_line import PlacedScan, ScanLine


def scan_at(stamp: float) -> LaserScan:
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=10.0,
        ranges=np.ones(3),
    )


class Odometry:
    """Known until a time; the robot is at (x of that scan, 0)."""

    def __init__(self, known: float) -> None:
        self.known, self.places = known, {}

    def __call__(self, scan: LaserScan) -> PlacedScan:
        if scan.stamp > self.known:
            raise TransformError("odom", "base_link", "not yet")
        return PlacedScan(scan, self.places.get(scan.stamp, Pose2D(scan.stamp)), Pose2D())


def taken(line: ScanLine, now: float = 0.0) -> list[float]:
    found = []
    while (placed := line.take(now)) is not None:
        found.append(placed.scan.stamp)
    return found


def test_scans_leave_once_they_can_be_placed() -> None:
    odometry = Odometry(known=1.0)
    line = ScanLine(odometry)
    for stamp in (1.0, 1.1, 1.2):
        line.put(scan_at(stamp), stamp)
    assert taken(line) == [1.0]
    odometry.known = 2.0
    assert taken(line) == [1.1, 1.2]
    assert (line.dropped, line.problem, len(line)) == (0, "", 0)


def test_a_scan_that_is_a_second_older_than_the_newest_is_dropped_with_the_reason() -> None:
    line = ScanLine(Odometry(known=0.0))
    line.put(scan_at(1.0), 1.0)
    line.put(scan_at(2.0), 2.0)
    assert taken(line, 2.0) == []
    assert line.dropped == 0
    line.put(scan_at(2.1), 2.1)
    assert taken(line, 2.1) == []
    assert (line.dropped, len(line)) == (1, 2)
    assert line.problem == "no transform from 'base_link' to 'odom': not yet"


def test_a_scan_that_waited_for_two_seconds_is_dropped() -> None:
    line = ScanLine(Odometry(known=0.0))
    line.put(scan_at(1.0), 50.0)
    assert taken(line, 52.0) == []
    assert line.dropped == 0
    assert taken(line, 52.1) == []
    assert line.dropped == 1


def test_two_scans_of_one_stamp_leave_once_each() -> None:
    line = ScanLine(Odometry(known=1.0))
    for stamp in (1.1, 1.0, 1.0):
        line.put(scan_at(stamp), stamp)
    assert taken(line) == [1.0, 1.0]
    assert len(line) == 1


@pytest.mark.parametrize("place", [Pose2D(5.9e22, 0.0), Pose2D(0.0, -2.8e7), Pose2D(float("nan"), 0.0)])
def test_an_odometry_that_is_no_place_is_never_handed_on(place: Pose2D) -> None:
    odometry = Odometry(known=9.0)
    odometry.places[1.0] = place  # as of a real robot whose serial line lost bits (real_lidar_odom.bag)
    line = ScanLine(odometry)
    for stamp in (1.0, 1.1, 2.2):
        line.put(scan_at(stamp), stamp)
    assert taken(line, 2.2) == [1.1, 2.2]
    assert line.dropped == 1
