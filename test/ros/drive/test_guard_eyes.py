"""What the collision guard of twist_mux is shown, without a master."""

from __future__ import annotations

import math
import threading

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")
import numpy as np
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

from rosbot_patrol.control.collision_guard import GuardParams
from rosbot_patrol.control.mux import SourceParams
from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Transform, Twist2D
from rosbot_patrol.ros.drive import twist_mux_node
from rosbot_patrol.ros.drive.twist_mux_node import Eyes, TwistMuxNode, TwistMuxParams
from rosbot_patrol.ros.messages.convert import scan_to_msg
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN
from rosbot_patrol.ros.simulator import messages
from rosbot_patrol.scan import LaserScan as Scan
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams

BACKWARDS, UPSIDE_DOWN, PITCHED_OVER = (0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
ON_ITS_SIDE = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
FRAMES = {"laser": Pose2D(0.02, 0.0, math.pi), "range_fl": Pose2D(0.1, 0.05, 0.13), "base_link": Pose2D()}


class Frames:
    """Stands in for tf: the robot stands at odom's origin."""

    laser = BACKWARDS

    def transform(self, target, source, stamp=None):
        pose = self.lookup(target, source, stamp)
        return Transform(pose.x, pose.y, 0.2, *self.laser)

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


def open_scan(**changes) -> LaserScan:
    values = {
        "stamp": 10.0,
        "frame_id": "laser",
        "angle_min": -math.pi,
        "angle_increment": math.tau / 360,
        "range_min": 0.2,
        "range_max": 12.0,
        "ranges": np.full(360, 5.0),
    }
    return scan_to_msg(Scan(**{**values, **changes}))


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


def post_at(angle: float) -> LaserScan:
    """A post 0.22 m away in a direction of the laser."""
    angles = -math.pi + math.tau / 360 * np.arange(360)
    return open_scan(ranges=np.where(np.abs(np.cos(angles - angle) - 1.0) < 0.05, 0.22, 5.0))


@pytest.mark.parametrize(
    ("laser", "angle"),
    [
        ((0.0, 0.0, 0.0, 1.0), 0.75),
        (BACKWARDS, 0.75 - math.pi),
        (UPSIDE_DOWN, -0.75),
        (PITCHED_OVER, math.pi - 0.75),
        ((0.5**0.5, 0.5**0.5, 0.0, 0.0), math.pi / 2 - 0.75),  # upside down and a quarter round
    ],
)
def test_a_post_on_the_left_is_on_the_left_however_the_laser_hangs(topics, monkeypatch, laser, angle):
    monkeypatch.setattr(Frames, "laser", laser)
    eyes = Eyes(TwistMuxParams(topics=(), collision_guard=GuardParams(half_length=0.25)), threading.Event())
    topics["scan"](post_at(angle))
    assert eyes.look()
    assert eyes.limit(Twist2D(0.0, 0.0, 1.5), 10.0).scale < 0.8
    assert eyes.limit(Twist2D(0.0, 0.0, -1.5), 10.0).scale == 1.0


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"ranges": np.zeros(360)}, "say nothing"),
        ({"ranges": np.full(360, math.nan)}, "say nothing"),
        ({"range_max": 0.0}, "range_max 0"),
        ({"range_max": math.nan}, "range_max nan"),
        ({"ranges": np.full(360, 170.0)}, "millimetres"),
        ({"angle_increment": 0.0}, "angle_increment is 0"),
        ({"stamp": 0.0}, "stamp is 0"),
        ({"ranges": np.empty(0)}, "no beams"),
    ],
)
def test_a_scan_that_says_nothing_slows_the_base_and_is_named_once(topics, caplog, changes, named):
    eyes = Eyes(TwistMuxParams(topics=()), threading.Event())
    for _ in range(50):
        topics["scan"](open_scan(**changes))
        assert not eyes.look()
    verdict = eyes.limit(Twist2D(0.3), 10.0)
    assert verdict.twist.vx == pytest.approx(0.1)
    assert named in verdict.reason
    (text,) = (record.getMessage() for record in caplog.records)
    assert named in text
    assert "'laser'" in text


def test_a_tilted_laser_is_as_none_and_is_named_once(topics, monkeypatch, caplog):
    monkeypatch.setattr(Frames, "laser", ON_ITS_SIDE)
    eyes = Eyes(TwistMuxParams(topics=()), threading.Event())
    for _ in range(50):
        topics["scan"](open_scan())
        assert not eyes.look()
    verdict = eyes.limit(Twist2D(0.3), 10.0)
    assert verdict.twist.vx == pytest.approx(0.1)
    assert "the laser 'laser' is tilted by 90 deg in 'base_link'" in verdict.reason
    assert len(caplog.records) == 1


@pytest.mark.parametrize("limit", [math.inf, 3.4028234663852886e38])
def test_a_scan_without_an_upper_limit_drives(topics, limit):
    eyes = Eyes(TwistMuxParams(topics=()), threading.Event())
    topics["scan"](open_scan(range_max=limit))
    assert eyes.look()
    assert eyes.limit(Twist2D(0.3), 10.0).scale == 1.0


class Sent:
    """Stands in for a publisher."""

    def __init__(self, *_, **__):
        self.messages = []

    def publish(self, message):
        self.messages.append(message)


class Told:
    """Stands in for Health: the last level and message."""

    def __init__(self):
        self.level = self.message = None

    def set(self, part, level, message, values=None):
        del part, values
        self.level, self.message = level, message


@pytest.fixture
def mux(topics, monkeypatch):
    monkeypatch.setattr(twist_mux_node.rospy, "Publisher", Sent)
    monkeypatch.setattr(twist_mux_node, "Health", Told)
    monkeypatch.setattr(TwistMuxNode, "_forget_the_gone", lambda self: None)
    source = SourceParams(name="teleop", topic="teleop", timeout=0.5, priority=1)
    return TwistMuxNode(TwistMuxParams(topics=(source,)))


def test_diagnostics_warn_while_the_guard_is_blind_and_say_why(mux, topics, caplog):
    wish = Twist()
    wish.linear.x = 0.3
    for k in range(30):
        topics["scan"](open_scan(ranges=np.zeros(360)))
        topics["teleop"](wish)
        mux._step(10.0 + 0.01 * k)
    assert mux._publisher.messages[-1].linear.x == pytest.approx(0.1)
    assert mux._health.level == WARN
    assert "teleop drives; no usable scan yet" in mux._health.message
    assert "say nothing" in mux._health.message
    assert len(caplog.records) == 2  # what is wrong with the scan, and who is held back
    topics["scan"](open_scan())
    topics["teleop"](wish)
    mux._step(10.3)
    assert mux._publisher.messages[-1].linear.x == pytest.approx(0.3)
    assert (mux._health.level, mux._health.message) == (OK, "teleop drives")


def test_diagnostics_warn_of_such_scans_while_nobody_commands_too(mux, topics):
    mux._step(10.0)
    assert (mux._health.level, mux._health.message) == (OK, "nobody commands")
    topics["scan"](open_scan(range_max=0.0))
    mux._step(10.1)
    assert mux._health.level == WARN
    assert "range_max 0" in mux._health.message
