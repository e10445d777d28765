"""The order in which scans leave their queue, with a tf that comes late."""

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, Transform
from rosbot_patrol.ros.runtime import scans
from rosbot_patrol.ros.runtime.scans import ScanQueue
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.scan_feed import ScanFeed


class LateTf:
    """Knows the odometry from `first` until `known`; after each look-up `known` moves on by `step`."""

    def __init__(self, known, step=0.0, first=0.0):
        self.first, self.known, self.step = first, known, step

    def transform(self, target, source):
        return Transform()

    def lookup(self, target, source, stamp):
        try:
            if not self.first <= stamp <= self.known:
                raise TransformError(target, source, "extrapolation")
            return Pose2D(stamp, 0.0, 0.0)
        finally:
            self.known += self.step


def scan_at(stamp):
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=10.0,
        ranges=np.ones(3),
    )


@pytest.fixture
def queued(monkeypatch):
    monkeypatch.setattr(scans, "POLL_S", 0.0)
    monkeypatch.setattr(scans, "IDLE_S", 0.0)
    monkeypatch.setattr(scans, "now", lambda: 0.0)

    def made(tf, stamps):
        feed = ScanFeed(tf, "odom", "base_link", lost="nothing happens")
        queue = ScanQueue(feed)
        for stamp in stamps:
            queue.put(scan_at(stamp))
        return queue, feed

    return made


def taken(made, tries=20):
    queue, _ = made
    found = [queue.take() for _ in range(tries)]
    return [placed.scan.stamp for placed in found if placed is not None]


def test_tf_that_comes_between_two_look_ups_changes_no_order(queued):
    # the first look-up is for 1.0 and fails; before the second one, for 1.1, all of tf arrives
    assert taken(queued(LateTf(0.9, step=1.0), [1.0, 1.1, 1.2])) == [1.0, 1.1, 1.2]


@pytest.mark.parametrize("step", [0.01, 0.03, 0.05, 0.11, 0.2])
def test_order_holds_however_tf_trickles_in(queued, step):
    stamps = [1.0 + 0.1 * i for i in range(8)]
    assert taken(queued(LateTf(0.5, step=step), stamps), tries=200) == stamps


def test_a_scan_from_before_tf_began_holds_up_no_other(queued):
    queue, feed = queued(LateTf(5.0, first=1.05), [1.0, 1.1, 1.2])
    assert taken((queue, feed)) == [1.1, 1.2]
    assert feed.dropped == 0  # it waits until it is a second old


def test_a_clock_that_is_set_back_begins_a_new_queue(queued):
    queue, feed = queued(LateTf(5.0), [4.0, 4.1])
    queue.put(scan_at(1.0))
    assert taken((queue, feed)) == [1.0]
