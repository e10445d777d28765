"""What a launched house tells of a mission, by states and ground truth fed by hand."""

from __future__ import annotations

import math
import threading

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")

import rospy
from nav_msgs.msg import Odometry
from rosbot_patrol.msg import PatrolState

from rosbot_patrol.ros.campaign.house import House, Mission


class Fed:
    """A house that nobody launched."""

    def __init__(self) -> None:
        self.house = House.__new__(House)
        self.house._lock = threading.RLock()
        self.house.pose = None
        self.mission = self.house._mission = Mission(room=1)
        self.yaw = self.now = 0.0
        self.turn(0.0)

    def state(self, state: str, why: str = "") -> None:
        self.told(self.made(state, why))

    def made(self, state: str, why: str = "") -> PatrolState:
        message = PatrolState(state=state, why=why)
        message.header.stamp = rospy.Time.from_sec(self.now)
        return message

    def told(self, message: PatrolState) -> None:
        self.house._on_state(message)

    def turn(self, degrees: float) -> None:
        for _ in range(10):
            self.yaw += math.radians(degrees) / 10.0
            self.now += 0.05
            odometry = Odometry()
            odometry.header.stamp = rospy.Time.from_sec(self.now)
            odometry.pose.pose.orientation.z = math.sin(self.yaw / 2.0)
            odometry.pose.pose.orientation.w = math.cos(self.yaw / 2.0)
            self.house._on_truth(odometry)

    @property
    def turned(self) -> float:
        return math.degrees(self.mission.turned)


def test_only_the_look_around_at_the_rooms_point_is_its_turn() -> None:
    fed = Fed()
    fed.state(PatrolState.DRIVING, "driving to room 1")
    fed.turn(-90.0)
    assert fed.turned == 0.0
    fed.state(PatrolState.LOOKING, "turning to look around, 0 of 360 degrees")
    fed.turn(-150.0)
    fed.state(PatrolState.LOOKING, "keeping the camera on somebody")
    fed.turn(10.0)
    fed.state(PatrolState.LOOKING, "turning to look around, 150 of 360 degrees")
    fed.turn(-220.0)
    assert fed.turned == pytest.approx(-360.0, abs=1e-3)
    # something like a person is looked at from elsewhere, with a turn of its own
    fed.state(PatrolState.LOOKING, "driving to a further viewpoint")
    fed.turn(40.0)
    fed.state(PatrolState.LOOKING, "turning to look around, 0 of 25 degrees")
    fed.turn(-25.0)
    assert fed.turned == pytest.approx(-360.0, abs=1e-3)
    fed.state(PatrolState.RETURNING, "driving home")
    fed.turn(70.0)
    assert fed.turned == pytest.approx(-360.0, abs=1e-3)


def test_a_state_that_is_told_late_is_as_long_as_its_stamps_say() -> None:
    fed = Fed()
    begun = fed.made(PatrolState.LOOKING, "turning to look around, 0 of 360 degrees")
    fed.turn(-60.0)
    fed.told(begun)
    fed.turn(-300.0)
    ended = fed.made(PatrolState.RETURNING, "driving home")
    fed.turn(-11.0)
    fed.told(ended)
    assert fed.turned == pytest.approx(-360.0, abs=1e-3)
