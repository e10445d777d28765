"""move_base's stack: what it sees of its inputs, and when it must not drive by them."""

from __future__ import annotations

import numpy as np
import pytest
from loop import Loop, tuned

from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.navigation.interfaces import Reason

GOAL = Pose2D(3.0, 1.0, 0.0)


def room() -> Grid:
    info = GridInfo(resolution=0.05, width=120, height=80, origin_x=-1.0, origin_y=-2.0)
    cells = np.zeros(info.shape, np.int8)
    cells[:2] = cells[-2:] = 100
    cells[:, :2] = cells[:, -2:] = 100
    return Grid(info, cells)


@pytest.fixture
def loop() -> Loop:
    made = Loop(known=room(), world=room(), tree=tuned())
    made.sense()
    made.stack.navigator.set_goal(GOAL, made.now)
    for _ in range(10):
        assert made.step() is None
    made.sense()
    return made


def test_with_all_inputs_it_drives(loop: Loop) -> None:
    cycle = loop.stack.step(loop.now)
    assert (cycle.reason, cycle.text) == (Reason.DRIVING, "driving")
    assert cycle.pose == pytest.approx(loop.pose)
    assert cycle.command.twist is not None
    assert cycle.command.twist.vx > 0.05


def test_velocities_that_stop_coming_stop_the_robot(loop: Loop) -> None:
    loop.stack.hear_velocity(Twist2D(0.1), loop.now - 0.6)
    cycle = loop.stack.step(loop.now)
    assert (cycle.reason, cycle.command.twist) == (Reason.NO_ODOMETRY, STOP)
    assert cycle.text == "no odometry on odom for 0.5 s"


def test_a_pose_that_is_too_old_stops_the_robot(loop: Loop) -> None:
    later = loop.now + 0.6
    loop.stack.hear_velocity(loop.velocity, later)
    cycle = loop.stack.step(later)
    assert (cycle.reason, cycle.command.twist, cycle.pose) == (Reason.POSE_UNKNOWN, STOP, None)
    assert "s old" in cycle.text


def test_scans_that_say_nothing_stop_the_robot_and_are_named(loop: Loop) -> None:
    for _ in range(15):
        loop.now += 0.1
        loop.sense(np.zeros(180))
    cycle = loop.stack.step(loop.now)
    assert (cycle.reason, cycle.command.twist) == (Reason.SENSORS_OLD, STOP)
    assert "Sensor data is out of date" in cycle.text
    assert "say nothing" in cycle.text


def test_it_stands_while_somebody_that_it_needs_has_gone(loop: Loop) -> None:
    loop.stack.departed = lambda: "/amcl has gone"
    cycle = loop.stack.step(loop.now)
    assert (cycle.reason, cycle.text, cycle.command.twist) == (Reason.DEPARTED, "/amcl has gone", STOP)


def test_a_planner_for_others_starts_anywhere(loop: Loop) -> None:
    poses = loop.stack.plan(Pose2D(0.0, 1.0), Pose2D(0.0, -1.0))
    assert poses[0, :2] == pytest.approx((0.0, 1.0), abs=0.1)
    assert poses[-1, :2] == pytest.approx((0.0, -1.0), abs=0.1)
