"""What the simulator sends, and the files that it reads, without a master."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")
from genpy import Message

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D, Twist2D
from rosbot_patrol.ros.simulator import messages
from rosbot_patrol.ros.simulator.node import SimulatorParams
from rosbot_patrol.simulation.physics.world import Touch
from rosbot_patrol.simulation.robot.battery import Battery, BatteryParams
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.robot.imu import ImuParams, ImuReading
from rosbot_patrol.simulation.sensors.camera import CameraParams
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams
from rosbot_patrol.simulation.sensors.sensor_places import read_sensors

ROOT = Path(__file__).parents[3]


def sent(message: Message) -> Message:
    """The message as a subscriber gets it."""
    buffer = io.BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


def test_odometry_is_in_its_frames() -> None:
    msg = sent(messages.odometry_msg(Pose2D(1.0, 2.0, math.pi / 2), Twist2D(0.1, 0.0, 0.2), 3.5, "odom"))
    assert (msg.header.frame_id, msg.child_frame_id, msg.header.stamp.to_sec()) == ("odom", "base_link", 3.5)
    assert msg.pose.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert msg.twist.twist.angular.z == 0.2
    assert msg.pose.covariance[0] == 1e-4
    assert msg.pose.covariance[35] == 1e-2


def test_pictures_keep_their_pixels() -> None:
    colour = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    msg = sent(messages.image_msg(colour, "rgb8", 1.0, "camera_depth_frame"))
    assert (msg.height, msg.width, msg.step, msg.encoding) == (4, 6, 18, "rgb8")
    assert np.array_equal(np.frombuffer(msg.data, np.uint8).reshape(4, 6, 3), colour)
    depth = np.full((4, 6), np.nan, np.float32)
    msg = sent(messages.image_msg(depth, "32FC1", 1.0, "camera_depth_frame"))
    assert msg.step == 24
    assert np.isnan(np.frombuffer(msg.data, np.float32)).all()


def test_points_lie_where_depth_and_optics_put_them() -> None:
    camera = CameraParams(width=64, height=48).intrinsics
    depth = np.full((48, 64), 2.0, np.float32)
    colour = np.tile(np.array([10, 20, 30], np.uint8), (48, 64, 1))
    msg = sent(messages.cloud_msg(colour, depth, camera, 1.0, "camera_depth_frame"))
    points = np.frombuffer(msg.data, np.float32).reshape(48, 64, 4)
    assert msg.point_step == 16
    assert [f.name for f in msg.fields] == ["x", "y", "z", "rgb"]
    assert points[0, 0, :3] == pytest.approx((-2 * camera.cx / camera.fx, -2 * camera.cy / camera.fy, 2.0))
    assert points[5, 7, 3:].view(np.uint32)[0] == 0x0A141E


def test_the_camera_has_gazebos_optics() -> None:
    msg = sent(messages.camera_info_msg(CameraParams().intrinsics, 1.0, "camera_depth_frame"))
    assert (msg.width, msg.height) == (640, 480)
    assert msg.K[0] == pytest.approx(554.38, abs=0.01)
    assert msg.P[0] == msg.K[0]


def test_small_sensors_and_contacts() -> None:
    reading = ImuReading(yaw=0.3, rates=(0.0, 0.0, 0.5), accelerations=(0.1, 0.0, 9.8))
    imu = sent(messages.imu_msg(reading, ImuParams(), 1.0))
    assert (imu.header.frame_id, imu.angular_velocity.z) == ("imu_link", 0.5)
    distance = sent(messages.range_msg(0.4, RangeParams(), 1.0, "range_fl"))
    assert (distance.header.frame_id, distance.range) == ("range_fl", pytest.approx(0.4))
    battery = sent(messages.battery_msg(Battery(BatteryParams()), 1.0))
    assert battery.percentage == 1.0
    assert battery.current < 0.0
    robot = load_robot(ROOT / "urdf" / "rosbot.urdf")
    joints = sent(messages.joints_msg(robot, (1.0, 2.0), (3.0, 4.0), 1.0))
    assert dict(zip(joints.name, joints.position, strict=True))["rear_right_wheel_hinge"] == 2.0
    touch = Touch(other="h", kind="fire_hydrant", position=(1, 2, 0), normal=(1, 0, 0), force=3.0)
    contacts = sent(messages.contacts_msg([touch], 1.0, "base_link"))
    assert (contacts.header.frame_id, contacts.contacts[0].kind) == ("map", "hydrant")


def test_the_shipped_files_fit_their_declarations(caplog: pytest.LogCaptureFixture) -> None:
    tree = yaml.safe_load((ROOT / "config" / "simulation.yaml").read_text())
    loaded = params.load(SimulatorParams, tree)
    assert not caplog.records
    assert loaded.rates.scan == 10.0
    assert [s.id for s in read_sensors(str(ROOT / "config" / "house_sensors.yaml"))] == [1, 2, 3, 4, 5, 6, 7]
    assert read_sensors("") == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sensors: 3", "expected a list"),
        ("[1, 2]", "expected the keys angle_unit and sensors"),
        ("sensors: [", "no valid yaml at line 1"),
        ("sensors: [{id: 1, room: 1, x: 0, y: 0}]", "yaw: is missing"),
        ("sensors: [{id: 300, room: 1, x: 0, y: 0, yaw: 0}]", "expected at most 255"),
        ("angle_unit: turns\nsensors: []", "expected rad or deg"),
        ("sensors: [{id: 1, room: 1, x: 0, y: 0, yaw: 0}, {id: 1, room: 2, x: 0, y: 0, yaw: 0}]", "used twice"),
    ],
)
def test_a_bad_sensor_file_is_told(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "sensors.yaml"
    file.write_text(text)
    with pytest.raises(ParamError, match=words):
        read_sensors(str(file))


def test_degrees_are_read_where_the_file_says_so(tmp_path: Path) -> None:
    file = tmp_path / "sensors.yaml"
    file.write_text("angle_unit: deg\nsensors: [{id: 1, room: 1, x: 0, y: 0, yaw: 90}]")
    assert read_sensors(str(file))[0].yaw == pytest.approx(math.pi / 2)
