"""Conversion of the engine's values to the simulator's messages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, JointState, PointCloud2, PointField, Range
from std_msgs.msg import Header

from rosbot_patrol.geometry import Pose2D, Twist2D, quaternion_from_yaw
from rosbot_patrol.msg import Contact, Contacts
from rosbot_patrol.ros.messages.convert import time_to_msg, twist_to_msg
from rosbot_patrol.simulation.physics.world import Touch
from rosbot_patrol.simulation.robot.battery import Battery
from rosbot_patrol.simulation.robot.description import RobotDescription
from rosbot_patrol.simulation.robot.imu import ImuParams, ImuReading
from rosbot_patrol.simulation.scene.scene import Intrinsics
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams

_UNKNOWN = 1e12
_KINDS = {"fire_hydrant": "hydrant"}


def header(stamp: float, frame: str) -> Header:
    """Make a header from time [s] and frame."""
    return Header(stamp=time_to_msg(stamp), frame_id=frame)


def odometry_msg(
    pose: Pose2D,
    twist: Twist2D,
    stamp: float,
    frame: str,
    *,
    child: str = "base_link",
    z: float = 0.0,
    exact: bool = False,
) -> Odometry:
    """Pose and velocity of the base, with the covariance of Gazebo's drive plug-in (a tenth of it if exact)."""
    msg = Odometry(header=header(stamp, frame), child_frame_id=child)
    place = msg.pose.pose
    place.position = Point(pose.x, pose.y, z)
    place.orientation = Quaternion(*quaternion_from_yaw(pose.yaw))
    msg.twist.twist = twist_to_msg(twist)
    spread = 1e-5 if exact else 1e-4
    diagonal = (spread, spread, _UNKNOWN, _UNKNOWN, _UNKNOWN, spread if exact else 1e-2)
    covariance = [0.0] * 36
    covariance[::7] = diagonal
    msg.pose.covariance = covariance
    msg.twist.covariance = list(covariance)
    return msg


def imu_msg(reading: ImuReading, params: ImuParams, stamp: float, frame: str = "imu_link") -> Imu:
    """A sample of the inertial unit; on a level floor roll and pitch have the variance of the heading."""
    msg = Imu(header=header(stamp, frame))
    msg.orientation = Quaternion(*quaternion_from_yaw(reading.yaw))
    msg.angular_velocity = Vector3(*reading.rates)
    msg.linear_acceleration = Vector3(*reading.accelerations)
    for covariance, spread in (
        (msg.orientation_covariance, params.heading_noise),
        (msg.angular_velocity_covariance, params.gyro_noise),
        (msg.linear_acceleration_covariance, params.accel_noise),
    ):
        covariance[0] = covariance[4] = covariance[8] = max(spread, 1e-6) ** 2
    return msg


def range_msg(distance: float, params: RangeParams, stamp: float, frame: str) -> Range:
    """A reading of a range sensor."""
    return Range(
        header=header(stamp, frame),
        radiation_type=Range.ULTRASOUND,
        field_of_view=params.field_of_view,
        min_range=params.range_min,
        max_range=params.range_max,
        range=distance,
    )


def battery_msg(battery: Battery, stamp: float, frame: str = "base_link") -> BatteryState:
    """Charge and voltage of the battery."""
    cells = battery.params.cells
    return BatteryState(
        header=header(stamp, frame),
        voltage=battery.voltage,
        temperature=math.nan,
        current=-battery.current,
        charge=battery.charge * battery.params.capacity,
        capacity=battery.params.capacity,
        design_capacity=battery.params.capacity,
        percentage=battery.charge,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_GOOD,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LION,
        present=True,
        cell_voltage=[battery.voltage / cells] * cells,
    )


def joints_msg(
    robot: RobotDescription, angles: tuple[float, float], speeds: tuple[float, float], stamp: float
) -> JointState:
    """Angles and speeds of all moving joints; undriven ones (casters) stay at zero."""
    turns = {joint: i for i, side in enumerate((robot.left, robot.right)) for joint in side}
    driven = [(hinge.forward, turns.get(hinge.joint)) for hinge in robot.hinges]
    return JointState(
        header=header(stamp, ""),
        name=[hinge.joint for hinge in robot.hinges],
        position=[0.0 if i is None else math.remainder(sign * angles[i], math.tau) for sign, i in driven],
        velocity=[0.0 if i is None else sign * speeds[i] for sign, i in driven],
    )


def contacts_msg(touches: list[Touch], stamp: float, robot_link: str) -> Contacts:
    """Contacts of the robot."""
    return Contacts(
        header=header(stamp, "map"),
        contacts=[
            Contact(
                robot_link=robot_link,
                other=t.other,
                kind=_KINDS.get(t.kind, t.kind),
                position=Point(*t.position),
                normal=Vector3(*t.normal),
                force=t.force,
            )
            for t in touches
        ],
    )


def camera_info_msg(camera: Intrinsics, stamp: float, frame: str) -> CameraInfo:
    """The camera's pinhole model."""
    k = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    return CameraInfo(
        header=header(stamp, frame),
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=k,
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0],
    )


def image_msg(picture: NDArray[Any], encoding: str, stamp: float, frame: str) -> Image:
    """A picture of shape (height, width, ...)."""
    height, width = picture.shape[:2]
    return Image(
        header=header(stamp, frame),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=picture.strides[0],
        data=picture.tobytes(),
    )


def cloud_msg(colour: NDArray[Any], depth: NDArray[Any], camera: Intrinsics, stamp: float, frame: str) -> PointCloud2:
    """Depth as points in the optical frame, with colours packed into the float `rgb` as upstream."""
    height, width = depth.shape
    points = np.empty((height, width, 4), dtype=np.float32)
    points[..., 0] = depth * ((np.arange(width, dtype=np.float32) - camera.cx) / camera.fx)
    points[..., 1] = depth * ((np.arange(height, dtype=np.float32) - camera.cy) / camera.fy)[:, None]
    points[..., 2] = depth
    packed = points[..., 3].view(np.uint32)
    packed[...] = colour[..., 0]
    packed <<= 8
    packed |= colour[..., 1]
    packed <<= 8
    packed |= colour[..., 2]
    names = ("x", "y", "z", "rgb")
    return PointCloud2(
        header=header(stamp, frame),
        height=height,
        width=width,
        fields=[PointField(n, 4 * i, PointField.FLOAT32, 1) for i, n in enumerate(names)],
        is_bigendian=False,
        point_step=16,
        row_step=16 * width,
        data=points.tobytes(),
        is_dense=False,
    )
