"""What the patrol makes of the scans that it hears, without a master."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, Transform
from rosbot_patrol.patrol.house.rooms import Room, Rooms
from rosbot_patrol.patrol.mission.params import EyesTopics, InputParams
from rosbot_patrol.ros.messages.convert import scan_from_msg, scan_to_msg
from rosbot_patrol.ros.patrol import sight as patrol_eyes
from rosbot_patrol.ros.patrol.sight import PatrolEyes
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN
from rosbot_patrol.scan import LaserScan, LevelScan

ROOMS = Rooms((Room(id=0, name="home", pose=Pose2D()),), source="rooms")


class Frames:
    """Stands in for tf: the robot stands at (1, 2) in map."""

    def __init__(self, laser=(0.0, 0.0, 0.0, 1.0)):
        self.laser, self.is_known = laser, True

    def transform(self, target, source, stamp=None):
        del stamp
        if not self.is_known:
            raise TransformError(target, source, "not yet")
        return Transform(1.0, 2.0, 0.2, *self.laser)


class Health:
    """Keeps what was told."""

    def __init__(self):
        self.parts = {}

    def set(self, part, level, message, values=None):
        self.parts[part] = level, message

    def drop(self, part):
        self.parts.pop(part)


class Depth:
    """No depth camera."""

    def tend(self, wall, *, is_over):
        pass


@pytest.fixture
def made(monkeypatch):
    monkeypatch.setattr(patrol_eyes.rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(patrol_eyes, "DepthRing", lambda *_: None)
    monkeypatch.setattr(patrol_eyes, "Lenses", lambda *_: None)
    monkeypatch.setattr(patrol_eyes.threading.Thread, "start", lambda self: None)
    monkeypatch.setattr(patrol_eyes, "now", lambda: 10.0)

    def make(frames):
        health = Health()
        eyes = PatrolEyes(EyesTopics(), ROOMS, ["person"], frames, frames=InputParams(), health=health)
        return eyes, health

    return make


def message(**changes):
    """Something 1 m off on the laser's left."""
    angles = -math.pi + math.tau / 360 * np.arange(360)
    values = {
        "stamp": 10.0,
        "frame_id": "laser",
        "angle_min": -math.pi,
        "angle_increment": math.tau / 360,
        "range_min": 0.2,
        "range_max": 12.0,
        "ranges": np.where(np.abs(angles - math.pi / 2) < 0.1, 1.0, math.inf),
    }
    return scan_to_msg(LaserScan(**{**values, **changes}))


@pytest.mark.parametrize(
    ("laser", "y"), [((0.0, 0.0, 0.0, 1.0), 3.0), ((1.0, 0.0, 0.0, 0.0), 1.0), ((0.0, 1.0, 0.0, 0.0), 3.0)]
)
def test_a_scan_has_its_place_in_map_however_the_laser_hangs(made, laser, y):
    eyes, health = made(Frames(laser))
    heard = message()
    scan = eyes.usable(heard)
    assert eyes.usable(heard) is scan
    view = eyes.look(scan)
    assert eyes.look(scan) is view
    points = LevelScan(view.scan, view.map_from_laser).points
    assert points.mean(axis=0) == pytest.approx((1.0, y), abs=0.02)
    assert health.parts["lidar"][0] == OK


@pytest.mark.parametrize("changes", [{"ranges": np.zeros(360)}, {"stamp": 0.0}, {"range_max": math.nan}])
def test_a_scan_that_says_nothing_is_as_none_and_is_told(made, caplog, changes):
    eyes, health = made(Frames())
    for _ in range(20):
        assert eyes.look(eyes.usable(message(**changes))) is None
    assert health.parts["lidar"][0] == WARN
    assert "is left out" in health.parts["lidar"][1]
    assert len(caplog.records) == 1
    assert eyes.look(eyes.usable(message())) is not None
    assert health.parts["lidar"][0] == OK


def test_what_is_told_of_the_lidar_ends_with_the_mission(made, monkeypatch):
    eyes, health = made(Frames())
    monkeypatch.setattr(eyes, "depth", Depth())
    eyes.usable(message(ranges=np.zeros(360)))
    eyes.take(is_busy=True)
    assert "lidar" in health.parts
    eyes.take(is_busy=False)
    assert "lidar" not in health.parts


def test_a_tilted_laser_is_as_none_and_is_told(made, caplog):
    eyes, health = made(Frames((0.6, 0.0, 0.0, 0.8)))
    for _ in range(20):
        assert eyes.look(eyes.usable(message())) is None
    assert health.parts["lidar"][0] == WARN
    assert "tilted by 74 deg in 'map'" in health.parts["lidar"][1]
    assert len(caplog.records) == 1


def test_a_place_that_is_not_known_yet_is_no_fault(made):
    frames = Frames()
    eyes, health = made(frames)
    frames.is_known = False
    assert eyes.look(eyes.usable(message())) is None
    assert "lidar" not in health.parts


def test_a_message_without_a_stamp_has_none_as_a_record():
    assert math.isnan(scan_from_msg(message(stamp=0.0)).stamp)
    assert scan_from_msg(message(ranges=np.array([math.nan, 1.0]))).ranges == pytest.approx(
        [math.nan, 1.0], nan_ok=True
    )
