"""Whom the robot waits for: scans that wait for tf, that are old, or that cannot be used."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rosbot_patrol.closed_loop.frames import BASE, ODOM, add_pose
from rosbot_patrol.control.give_way import GiveWayParams
from rosbot_patrol.control.movers import MoverParams
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.navigation.people import People
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge, TransformTree

AHEAD = Twist2D(0.3)


def scan_at(stamp: float, leg: float) -> LaserScan:
    """A round room with a leg ahead at a distance [m]."""
    angles = -math.pi + math.radians(1.0) * np.arange(360)
    return LaserScan(
        stamp=stamp,
        frame_id=BASE,
        angle_min=-math.pi,
        angle_increment=math.radians(1.0),
        range_min=0.1,
        range_max=12.0,
        ranges=np.where((np.abs(leg * np.sin(angles)) < 0.08) & (np.abs(angles) < 1.0), leg, 3.8),
    )


class Walk:
    """Somebody who comes towards the robot at 1 m/s."""

    def __init__(self) -> None:
        self.frames = TransformTree()
        self.people = People(self.frames, ODOM, MoverParams(), GiveWayParams())
        self.now = 10.0

    def see(self, seconds: float, *, has_tf: bool = True) -> None:
        for _ in range(round(10 * seconds)):
            self.now += 0.1
            if has_tf:
                add_pose(self.frames, ODOM, BASE, Pose2D(), self.now)
            self.people.hear(scan_at(self.now, 3.5 - (self.now - 10.0)))
            self.people.look(self.now)

    def waits(self) -> str:
        return self.people.waits(AHEAD, Pose2D(), self.now)


def test_the_robot_waits_for_somebody_who_comes() -> None:
    walk = Walk()
    walk.see(1.5)
    assert walk.waits().startswith("someone comes this way")


def test_scans_without_a_place_show_nobody_until_tf_comes() -> None:
    walk = Walk()
    walk.see(1.5, has_tf=False)
    assert walk.waits() == ""
    walk.see(1.0)
    assert walk.people.movers(walk.now)


def test_an_old_scan_shows_nobody() -> None:
    walk = Walk()
    walk.see(1.5)
    assert walk.people.movers(walk.now)
    assert walk.people.movers(walk.now + 1.1) == []


def test_scans_that_cannot_be_used_are_named_once(caplog: pytest.LogCaptureFixture) -> None:
    walk = Walk()
    walk.frames.add(Edge(BASE, "tilted", 0.0, 0.0, 0.0, 0.2, 0.5, 0.0, 0.0, 0.75**0.5), is_static=True)
    add_pose(walk.frames, ODOM, BASE, Pose2D(), 10.0)
    for _ in range(3):
        walk.people.hear(replace(scan_at(10.0, 2.0), frame_id="tilted"))
        walk.people.look(10.0)
        walk.people.hear(replace(scan_at(10.0, 2.0), ranges=np.zeros(360)))
        walk.people.look(10.0)
    assert [text.endswith("; nobody is waited for") for text in caplog.messages] == [True, True]
    assert "tilted by 60 deg" in caplog.text
    assert "say nothing" in caplog.text
