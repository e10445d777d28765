"""What amcl and slam_gmapping say of scans that they cannot use, without a master."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.runtime import scan_watch
from rosbot_patrol.ros.runtime.scan_watch import ScanWatch
from rosbot_patrol.scan import LaserScan


class Clock:
    time = 100.0


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(scan_watch, "now", lambda: clock.time)
    return clock


def scan_of(value: float, **changes: float) -> LaserScan:
    values = {"stamp": 10.0, "angle_min": -math.pi, "angle_increment": 0.017, "range_min": 0.1, "range_max": 12.0}
    return LaserScan(frame_id="laser", ranges=np.full(360, value), **{**values, **changes})


def hear(watch: ScanWatch, clock: Clock, scan: LaserScan, seconds: float) -> list[bool]:
    heard = []
    for _ in range(round(10 * seconds)):
        clock.time += 0.1
        watch.hear()
        heard.append(watch.is_usable(scan))
    return heard


@pytest.mark.parametrize(
    ("scan", "named"),
    [
        (scan_of(0.0), "say nothing"),
        (scan_of(math.nan), "say nothing"),
        (scan_of(2.0, range_max=math.nan), "range_max nan"),
    ],
)
def test_scans_that_say_nothing_are_told_until_they_are_well(clock, caplog, scan, named):
    watch = ScanWatch(None, "no pose is published")
    assert all(hear(watch, clock, scan_of(2.0), 1.0))
    assert not any(hear(watch, clock, scan, 0.5))
    assert watch.tend(clock.time) == ""
    assert not any(hear(watch, clock, scan, 5.0))
    assert named in watch.tend(clock.time)
    assert watch.tend(clock.time).endswith("; no pose is published")
    assert len(caplog.records) == 1
    assert all(hear(watch, clock, scan_of(2.0), 0.2))
    assert watch.tend(clock.time) == ""


@pytest.mark.parametrize("limit", [math.inf, 3.4028234663852886e38])
def test_a_scan_without_an_upper_limit_is_usable(clock, limit):
    watch = ScanWatch(None, "nothing is mapped")
    assert all(hear(watch, clock, scan_of(2.0, range_max=limit), 1.0))
