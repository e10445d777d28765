"""What the owner orders, in the whole house: emergency stop through the mux, calls while it holds, modes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosbot_patrol.msg import PatrolState
from rosbot_patrol.srv import Arm
from std_srvs.srv import SetBool

from rosbot_patrol.ros.campaign.house import House
from rosbot_patrol.ros.campaign.ports import BRIDGES, free_port

pytestmark = pytest.mark.system

ROOM, OTHER = 1, 2


def stop(press: bool) -> str:
    rospy.wait_for_service("/patrol/emergency_stop", 10.0)
    answer = rospy.ServiceProxy("/patrol/emergency_stop", SetBool)(press)
    assert answer.success
    return str(answer.message)


def arm(mode: str) -> None:
    rospy.wait_for_service("/patrol/arm", 10.0)
    assert rospy.ServiceProxy("/patrol/arm", Arm)(mode).accepted


def pushed(house: House, topic: str, seconds: float, done: Callable[[], bool] = lambda: False) -> None:
    """Somebody else wants to drive, ten times a second."""
    wheels = rospy.Publisher(topic, Twist, queue_size=1)
    wish = Twist()
    wish.linear.x = 0.2
    until = time.monotonic() + seconds
    while time.monotonic() < until and not done():
        wheels.publish(wish)
        time.sleep(0.05)
    wheels.unregister()


@pytest.mark.slow
def test_the_emergency_stop_holds_whoever_wants_to_drive_and_modes_decide_who_is_heard(
    master: object, folder: Path
) -> None:
    speeds: list[float] = []

    def hear(message: Odometry) -> None:
        speeds.append(math.hypot(message.twist.twist.linear.x, message.twist.twist.angular.z))

    subscriber = rospy.Subscriber("/ground_truth/odom", Odometry, hear)
    with House(folder, rate=1.0, bridge_port=free_port(BRIDGES)) as house:
        house.wait_ready(90.0)

        house.trigger(ROOM)
        house.wait(lambda: len(speeds) > 10 and min(speeds[-5:]) > 0.1, 30.0, "the robot on its way")
        stop(True)
        house.wait(lambda: len(speeds) > 10 and max(speeds[-10:]) < 0.01, 5.0, "the robot at rest")
        assert house.state is not None
        house.wait(lambda: house.state is not None and house.state.state == PatrolState.STOPPED, 5.0, "the word of it")
        assert house.state.last_verdict == "unverified"
        stood = house.pose
        for topic in ("/cmd_vel/teleop", "/cmd_vel/patrol", "/cmd_vel/move_base"):
            pushed(house, topic, 0.7)
        house.trigger(OTHER)  # it waits for the release
        pushed(house, "/cmd_vel/teleop", 0.7)
        assert stood is not None
        assert house.pose is not None
        assert math.dist(stood[:2], house.pose[:2]) < 0.02
        assert house.state.state == PatrolState.STOPPED

        stop(False)
        house.wait(lambda: house.state is not None and house.state.state == PatrolState.LOOKING, 120.0, "the next look")
        assert house.state.room_id == OTHER

        arm("disarmed")
        house.wait(lambda: house.state is not None and house.state.state == PatrolState.IDLE, 120.0, "the robot home")
        assert house.state.last_verdict == "unverified"
        house.trigger(ROOM)
        time.sleep(2.0)
        assert house.state.state == PatrolState.IDLE
        told = {mail.name.split("-")[0] for mail in house.mails()}
        assert told == {"emergency_stop", "disarmed"}  # nothing else, but these the owner hears of
    subscriber.unregister()
