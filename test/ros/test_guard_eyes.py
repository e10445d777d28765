"""What the collision guard of twist_mux is shown, without a master."""

from __future__ import annotations

import math
import threading

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")
import numpy as np
from sensor_msgs.msg import LaserScan

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.ros import simulator_messages as messages
from rosbot_patrol.ros import twist_mux_node
from rosbot_patrol.ros.convert import scan_to_msg
from rosbot_patrol.ros.twist_mux_node import Eyes, TwistMuxParams
from rosbot_patrol.scan import LaserScan as Scan
from rosbot_patrol.simulation.range_sensors import RangeParams

FRAMES = {"laser": Pose2D(0.02, 0.0, math.pi), "range_fl": Pose2D(0.1, 0.05, 0.13), "base_link": Pose2D()}


class Frames:
    """Stands in for tf: the robot stands at odom's origin."""

    def lookup(self, target, source, stamp=None):
        del target, stamp
        if source not in FRAMES:
            raise TransformError("base_link", source, "no such frame")
        return FRAMES[source]


@pytest.fixture
def topics(monkeypatch):
    callbacks = {}
    monkeypatch.setattr(twist_mux_node, "Transforms", Frames)
    monkeypatch.setattr(twist_mux_node, "now", lambda: 10.0)
    monkeypatch.setattr(
        twist_mux_node.rospy, "Subscriber", lambda topic, kind, callback, **_: callbacks.__setitem__(topic, callback)
    )
    return callbacks


def open_scan() -> LaserScan:
    scan = Scan(
        stamp=10.0,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / 360,
        range_min=0.2,
        range_max=12.0,
        ranges=np.full(360, 5.0),
    )
    return scan_to_msg(scan)


def test_a_range_sensor_that_meets_something_twice_stops_the_base(topics):
    eyes = Eyes(TwistMuxParams(topics=(), range_topics=("/range/fl",)), threading.Event())
    for _ in range(2):
        topics["scan"](open_scan())
        topics["/range/fl"](messages.range_msg(0.05, RangeParams(), 10.0, "range_fl"))
        assert eyes.look()
    assert eyes.limit(Twist2D(0.3), 10.0).twist == STOP
    assert eyes.limit(Twist2D(-0.3), 10.0).scale == 1.0


def test_a_sensor_whose_place_is_not_known_is_left_out_and_told(topics, caplog):
    eyes = Eyes(TwistMuxParams(topics=(), range_topics=("/range/fl",)), threading.Event())
    for _ in range(2):
        topics["scan"](open_scan())
        topics["/range/fl"](messages.range_msg(0.05, RangeParams(), 10.0, "elsewhere"))
        assert eyes.look()
    assert "cannot place /range/fl" in caplog.text
    assert eyes.limit(Twist2D(0.3), 10.0).scale == 1.0


def test_without_range_topics_it_listens_to_the_scan_alone(topics):
    Eyes(TwistMuxParams(topics=()), threading.Event())
    assert list(topics) == ["scan"]
