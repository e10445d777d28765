"""Upstream's own test bags, by upstream's settings and within upstream's tolerances (robot_localization, BSD-3)."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from rosbot_patrol.ekf.core import FilterCore
from rosbot_patrol.ekf.filter import Ekf
from rosbot_patrol.ekf.readings import AccelerationReading, Frame, PoseReading, TwistReading
from rosbot_patrol.ekf.sensor import SensorConfig, Surroundings
from rosbot_patrol.ekf.state import SIZE, Array, from_quaternion, rotation

SHARED = Path(__file__).parents[4] / "shared" / "datasets"


def bits(text: str) -> np.ndarray:
    return np.array([each == "1" for each in text.replace(" ", "")])


def xyz(value: Any) -> Array:
    return np.array([value.x, value.y, value.z])


def turned(q: Any) -> Array:
    norm = math.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2)
    return from_quaternion(q.x / norm, q.y / norm, q.z / norm, q.w / norm)


def drive(bag: Path, core: FilterCore, rate: float, odometry: str, imu: str) -> Array:
    """Play a bag through the filter; returns the last position."""
    due = None
    with AnyReader([bag]) as reader:
        wanted = [each for each in reader.connections if each.topic in (odometry, imu)]
        for connection, stamp_ns, raw in reader.messages(wanted):
            now = stamp_ns * 1e-9
            due = now if due is None else due
            while due <= now:
                core.update(due)
                due += 1.0 / rate
            message = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
            if connection.topic == odometry:
                core.hear("odom0", PoseReading(stamp, "", Frame(), np.eye(6)))
                twist = message.twist.twist
                covariance = np.array(message.twist.covariance).reshape(6, 6)
                core.hear("odom0", TwistReading(stamp, "", xyz(twist.linear), xyz(twist.angular), covariance))
                continue
            own = turned(message.orientation)
            spread = np.zeros((6, 6))
            spread[3:, 3:] = np.array(message.orientation_covariance).reshape(3, 3)
            core.hear("imu0", PoseReading(stamp, "imu", Frame(own), spread, is_orientation=True))
            spread = np.zeros((6, 6))
            spread[3:, 3:] = np.array(message.angular_velocity_covariance).reshape(3, 3)
            core.hear("imu0", TwistReading(stamp, "imu", np.zeros(3), xyz(message.angular_velocity), spread))
            spread = np.array(message.linear_acceleration_covariance).reshape(3, 3)
            core.hear("imu0", AccelerationReading(stamp, "imu", xyz(message.linear_acceleration), spread, own))
    core.update(math.inf)
    return core.ekf.state[:3]


def made(odometry: str, imu: str, noise: list[float], mounting: Frame, timeout: float) -> FilterCore:
    def lookup(target: str, source: str, stamp: float) -> Frame:
        return mounting if source == "imu" else Frame()

    around = Surroundings(
        world="odom",
        base="base_link",
        lookup=lookup,
        is_planar=False,
        gravity=9.80665,
    )
    configs = {
        "odom0": SensorConfig(topic="odom0", mask=bits(odometry)),
        "imu0": SensorConfig(topic="imu0", mask=bits(imu), removes_gravity=True),
    }
    return FilterCore(Ekf(np.diag(noise), np.eye(SIZE) * 1e-9), configs, around, timeout)


def jackal() -> tuple[FilterCore, float, str, str]:
    noise = [0.03, 0.03, 0.4, 0.03, 0.03, 0.06, 0.025, 0.025, 0.05, 0.002, 0.002, 0.004, 0.01, 0.01, 0.01]
    core = made("000000 111 001 000", "000111 000 111 111", noise, Frame(), 0.1)
    return core, 50.0, "/jackal_velocity_controller/odom", "/imu/data"


def husky() -> tuple[FilterCore, float, str, str]:
    noise = [0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015]
    mounting = Frame(rotation(math.pi / 2, 0.0, -math.pi / 2), np.array([0.0, -0.3, 0.52]))
    core = made("000000 111 000 000", "000111 000 110 111", noise, mounting, 0.1)
    return core, 30.0, "/husky_velocity_controller/odom", "/imu/data"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bag", "setting", "expected", "tolerance"),
    [
        ("robot_localization_test2.bag", jackal, (1.0206, 3.4292, 0.7419), 0.1383),
        ("robot_localization_test1.bag", husky, (-40.0454, -76.9988, -2.6974), 1.0452),
    ],
)
def test_the_robot_ends_where_upstream_says(
    bag: str,
    setting: Callable[[], tuple[FilterCore, float, str, str]],
    expected: tuple[float, float, float],
    tolerance: float,
) -> None:
    path = SHARED / bag
    if not path.exists():
        pytest.skip(f"{path} is not there: upstream's bags lie beside the repository")
    core, rate, odometry, imu = setting()
    found = drive(path, core, rate, odometry, imu)
    assert np.linalg.norm(found - np.array(expected)) < tolerance
