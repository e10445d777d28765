"""What amcl and slam_gmapping say of scans that they cannot use, without a master."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.runtime import scans
from rosbot_patrol.ros.runtime.scans import ScanWatch
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_feed import ScanFeed
from rosbot_patrol.tf.tree import TransformTree


class Clock:
    time = 100.0


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(scans, "now", lambda: clock.time)
    return clock


def scan_of(value: float, **changes: float) -> LaserScan:
    values = {"stamp": 10.0, "angle_min": -math.pi, "angle_increment": 0.017, "range_min": 0.1, "range_max": 12.0}
    return LaserScan(frame_id="laser", ranges=np.full(360, value), **{**values, **changes})


class Listener:
    """A node's feed of scans and its watch over them."""

    def __init__(self, clock: Clock, lost: str) -> None:
        self.clock = clock
        self.feed = ScanFeed(TransformTree(), "odom", "base_link", lost=lost)
        self.watch = ScanWatch(None, self.feed.check)

    def hear(self, scan: LaserScan, seconds: float) -> list[bool]:
        heard = []
        for _ in range(round(10 * seconds)):
            self.clock.time += 0.1
            self.watch.hear()
            heard.append(self.feed.hear(scan, self.clock.time))
        return heard

    def tend(self) -> str:
        return self.watch.tend(self.clock.time)


@pytest.mark.parametrize(
    ("scan", "named"),
    [
        (scan_of(0.0), "say nothing"),
        (scan_of(math.nan), "say nothing"),
        (scan_of(2.0, range_max=math.nan), "range_max nan"),
    ],
)
def test_scans_that_say_nothing_are_told_until_they_are_well(clock, caplog, scan, named):
    listener = Listener(clock, "no pose is published")
    assert all(listener.hear(scan_of(2.0), 1.0))
    assert not any(listener.hear(scan, 0.5))
    assert listener.tend() == ""
    assert not any(listener.hear(scan, 5.0))
    assert named in listener.tend()
    assert listener.tend().endswith("; no pose is published")
    assert len(caplog.records) == 1
    assert all(listener.hear(scan_of(2.0), 0.2))
    assert listener.tend() == ""


@pytest.mark.parametrize("limit", [math.inf, 3.4028234663852886e38])
def test_a_scan_without_an_upper_limit_is_usable(clock, limit):
    listener = Listener(clock, "nothing is mapped")
    assert all(listener.hear(scan_of(2.0, range_max=limit), 1.0))
