"""The emulated base serialises as ROS does: its messages are read by their classes, and have the sums of those."""

from __future__ import annotations

import math
from io import BytesIO

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")
from geometry_msgs.msg import PoseStamped, Twist
from rosbot_ekf.msg import Imu as OldImu
from rosbot_ekf.srv import ConfigurationRequest, ConfigurationResponse
from sensor_msgs.msg import BatteryState, Imu, Range

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.simulation.devices import rosbot_messages as messages


@pytest.mark.parametrize(
    ("name", "kind", "data"),
    [
        ("pose", PoseStamped, messages.pose(1.0, -2.0, 0.5, 12.25)),
        ("velocity", Twist, messages.twist((0.3, 0.1), -0.4)),
        ("imu", Imu, messages.imu(0.5, -0.4, 12.25)),
        ("mpu9250", OldImu, messages.old_imu(0.5, -0.4, 12.25)),
        ("battery", BatteryState, messages.battery(11.5)),
        ("range", Range, messages.distance("range_fl", -1.0, 12.25)),
    ],
)
def test_a_message_is_read_whole_by_its_class(name: str, kind: type, data: bytes) -> None:
    assert messages.TYPES[name] == (kind._type, kind._md5sum)
    message = kind().deserialize(data)
    again = BytesIO()
    message.serialize(again)
    assert again.getvalue() == data


def test_values_arrive() -> None:
    pose = PoseStamped().deserialize(messages.pose(1.0, -2.0, 0.5, 12.25))
    assert (pose.header.frame_id, pose.header.stamp.to_sec()) == ("odom", 12.25)
    assert (pose.pose.position.x, pose.pose.position.y) == (1.0, -2.0)
    assert 2.0 * math.atan2(pose.pose.orientation.z, pose.pose.orientation.w) == pytest.approx(0.5)
    battery = BatteryState().deserialize(messages.battery(11.5))
    assert (battery.voltage, battery.percentage, battery.present) == (11.5, 0.0, False)


def test_the_service_config() -> None:
    kind, request, response = messages.CONFIG
    assert (request, response) == (ConfigurationRequest._md5sum, ConfigurationResponse._md5sum)
    assert kind == "rosbot_ekf/Configuration"
    asked = BytesIO()
    ConfigurationRequest(command="SKIN", data="MEC").serialize(asked)
    assert messages.read_config(asked.getvalue()) == ("SKIN", "MEC")
    assert ConfigurationResponse().deserialize(messages.config_answer("ok", 2)).result == 2
    with pytest.raises(ProtocolError, match="a request of 3 bytes ends too early"):
        messages.read_config(b"\x04\0\0")
