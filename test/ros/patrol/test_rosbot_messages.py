"""Messages of a ROSbot's base: what its firmware was built with, and what the patrol takes from its battery."""

import math
from types import MethodType, SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from rosbot_ekf.msg import Imu
from rosbot_ekf.srv import Configuration, ConfigurationResponse
from sensor_msgs.msg import BatteryState, Range

from rosbot_patrol.ros.bridge.channels import message_class, service_class
from rosbot_patrol.ros.drive.twist_mux_node import Eyes
from rosbot_patrol.ros.messages.senses import battery_from_msg


def test_sums_are_those_of_the_firmware():
    assert Imu._md5sum == "3d83bdcabfe2927ed38c36f102a9f646"
    assert Configuration._request_class._md5sum == "b116973260063b7b02b501a288810d3d"
    assert Configuration._response_class._md5sum == "d26ad64e1f52355ee24245b602a171ba"
    assert Configuration._md5sum == "b942000b3d255d27335aa543bc4443e3"
    answer = ConfigurationResponse
    assert (answer.SUCCESS, answer.FAILURE, answer.COMMAND_NOT_FOUND) == (0, 1, 2)


def test_the_bridge_finds_them():
    assert message_class("rosbot_ekf/Imu") is Imu
    assert service_class("rosbot_ekf/Configuration") is Configuration


def test_what_the_patrol_takes_from_a_battery():
    rosbot = battery_from_msg(
        BatteryState(voltage=12.4, power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LION)
    )
    assert (rosbot.share, rosbot.voltage, rosbot.is_charging) == (None, 12.4, False)
    empty = battery_from_msg(BatteryState(voltage=math.nan, percentage=0.0, present=True))
    assert (empty.share, empty.voltage) == (0.0, None)
    turtlebot3 = battery_from_msg(BatteryState(voltage=12.5, percentage=1.126, present=True, power_supply_status=1))
    assert (turtlebot3.share, turtlebot3.voltage, turtlebot3.is_charging) == (None, 12.5, True)


def test_a_range_sensor_without_a_frame_or_with_a_negative_reading_is_told_and_left_out(caplog):
    guard = SimpleNamespace(see_range=lambda *_: pytest.fail("placed"))
    eyes = SimpleNamespace(_logged_at=-math.inf, _mounts={}, guard=guard)
    eyes._complain = MethodType(Eyes._complain, eyes)
    eyes._mount = MethodType(Eyes._mount, eyes)
    Eyes._look_low(eyes, "/range/fl", Range(range=0.4), 1.0)
    assert "cannot place /range/fl: its messages name no frame" in caplog.text
    eyes._logged_at = -math.inf
    Eyes._look_low(eyes, "/range/fr", Range(range=-1.0), 1.0)
    assert "/range/fr says -1 m, as a broken sensor does" in caplog.text
