"""The parts of a spawned robot: drive, odometry, battery, inertial unit, and the mounting of its sensors."""

from __future__ import annotations

import logging
import math
from typing import Protocol

import numpy as np

from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, Transform, Twist2D
from rosbot_patrol.simulation.noise import noise_of
from rosbot_patrol.simulation.robot.battery import Battery, BatteryParams
from rosbot_patrol.simulation.robot.description import FrameParams, RobotDescription
from rosbot_patrol.simulation.robot.drive import Drive, DriveParams
from rosbot_patrol.simulation.robot.imu import Imu, ImuParams
from rosbot_patrol.simulation.robot.odometry import EncoderOdometry, OdometryParams
from rosbot_patrol.simulation.scene.matrices import Matrix, to_pose2d, to_quaternion
from rosbot_patrol.simulation.scene.shapes import planar_radius
from rosbot_patrol.simulation.sensors.lidar import LidarParams

log = logging.getLogger(__name__)


class EquipmentParams(Protocol):
    """The engine's parameters that concern the robot."""

    @property
    def frames(self) -> FrameParams:
        """Links of the sensors."""

    @property
    def drive(self) -> DriveParams:
        """The base."""

    @property
    def encoder(self) -> OdometryParams:
        """Its odometry."""

    @property
    def lidar(self) -> LidarParams:
        """The lidar."""

    @property
    def imu(self) -> ImuParams:
        """The inertial unit."""

    @property
    def battery(self) -> BatteryParams:
        """The battery."""

    @property
    def seed(self) -> int:
        """Seed of all noise."""


class Equipment:
    """The robot's own parts, once a robot has been spawned.

    Args:
        params: parameters of the parts.
        description: the robot.
        pose: initial pose.

    Raises:
        WorldError: a wheel or sensor named by the parameters does not exist, or no wheel gives its radius.
    """

    def __init__(self, params: EquipmentParams, description: RobotDescription, pose: Pose2D) -> None:
        p = params
        robot = description.fitted(p.drive.left_joints, p.drive.right_joints, p.frames)
        self.description = robot
        self.start = pose
        self.radius = planar_radius(robot.body)
        fitted = p.drive.fitted(robot)
        self.drive = Drive(fitted, noise_of(p.seed, "slip"))
        self.odometry = EncoderOdometry(p.encoder, fitted.wheel_radius, fitted.effective_track)
        self.imu = Imu(p.imu, noise_of(p.seed, "imu walk"))
        self.battery = Battery(p.battery)
        self.turned = np.zeros(2)  # angles of the wheels, left and right [rad]
        self.base_from_laser: Pose2D | None = None
        self.is_laser_flipped = False
        self.lidar_height = 0.0
        if robot.laser is not None:
            self.base_from_laser = to_pose2d(robot.laser.pose)
            self.is_laser_flipped = bool(robot.laser.pose[2, 2] < 0.0)
            self.lidar_height = robot.base_height + float(robot.laser.pose[2, 3]) + p.lidar.height_offset
        self.base_from_ranges = {m.frame: to_pose2d(m.pose) for m in robot.ranges}
        heights = [m.pose[2, 3] for m in robot.ranges]
        self.range_height = robot.base_height + float(np.mean(heights)) if heights else 0.05
        self.base_from_optical: Matrix | None = None if robot.camera is None else robot.camera.pose
        self.imu.reset(pose.yaw)
        sensors = {"lidar": robot.laser, "camera": robot.camera, "inertial unit": robot.imu}
        missing = [name for name, mount in sensors.items() if mount is None]
        if missing:
            log.info("robot '%s' has no %s: nothing is sent of it", robot.name, " and no ".join(missing))

    @property
    def wheels(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Angles [rad] and speeds [rad/s] of the left and the right wheels."""
        return (float(self.turned[0]), float(self.turned[1])), (self.drive.left, self.drive.right)

    @property
    def laser(self) -> tuple[str, Pose2D]:
        """The lidar's frame and base_from_laser; raises WorldError if the robot has none."""
        if self.description.laser is None or self.base_from_laser is None:
            raise WorldError(f"robot '{self.description.name}'", "has no lidar")
        return self.description.laser.frame, self.base_from_laser

    @property
    def laser_transform(self) -> Transform:
        """base_from_laser in space; raises WorldError if the robot has no lidar."""
        if self.description.laser is None:
            raise WorldError(f"robot '{self.description.name}'", "has no lidar")
        matrix = self.description.laser.pose
        x, y, z = matrix[:3, 3].tolist()
        return Transform(x, y, z, *to_quaternion(matrix))

    def laser_twist(self, twist: Twist2D) -> Twist2D:
        """Velocity of the lidar in its own plane, from the base's velocity."""
        place = self.laser[1]
        vx, vy = twist.vx - twist.wz * place.y, twist.vy + twist.wz * place.x
        c, s = math.cos(place.yaw), math.sin(place.yaw)
        return Twist2D(c * vx + s * vy, c * vy - s * vx, twist.wz)
