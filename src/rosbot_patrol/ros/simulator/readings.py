"""The robot's readings as messages, each at its rate of simulated time and only with a subscriber."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, JointState, LaserScan, PointCloud2, Range
from tf2_msgs.msg import TFMessage

from rosbot_patrol.geometry import Pose2D, Twist2D, compose, invert
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.convert import scan_to_msg, transform_to_msg
from rosbot_patrol.ros.simulator import messages
from rosbot_patrol.simulation.engine import Engine

Due = tuple[float, int, Callable[[float], None]]  # rate [Hz], offset in ticks, sender by the time [s]

_RANGE_FRAMES = ("range_fl", "range_fr", "range_rl", "range_rr")  # advertised before the robot is spawned


@dataclass(frozen=True, kw_only=True)
class RateParams:
    """Publishing rates in simulated time, as averages: each message falls on a whole hundredth of a second."""

    odometry: float = param(20.0, unit="Hz", lo=0.1, hi=100.0, doc="rate of /odom and its transform")
    scan: float = param(10.0, unit="Hz", lo=0.1, hi=50.0, doc="rate of /scan (Gazebo: 40)")
    camera: float = param(10.0, unit="Hz", lo=0.1, hi=50.0, doc="rate of the camera's five topics")
    imu: float = param(10.0, unit="Hz", lo=0.1, hi=100.0, doc="rate of /rosbot/imu")
    range: float = param(5.0, unit="Hz", lo=0.1, hi=50.0, doc="rate of /range/*")
    joints: float = param(10.0, unit="Hz", lo=0.1, hi=100.0, doc="rate of /joint_states (Gazebo: 50)")
    battery: float = param(1.0, unit="Hz", lo=0.01, hi=10.0, doc="rate of /battery")
    ground_truth: float = param(20.0, unit="Hz", lo=0.1, hi=100.0, doc="rate of /ground_truth/odom")
    actors: float = param(5.0, unit="Hz", lo=0.1, hi=100.0, doc="rate of /ground_truth/actors")


class Readings:
    """The publishers of the robot's sensors.

    Args:
        engine: the simulated world.
        rates: publishing rates.
        exact_odometry: /odom is exact, as in Gazebo.

    Attributes:
        due: what to send, and when.
    """

    def __init__(self, engine: Engine, rates: RateParams, *, exact_odometry: bool = False) -> None:
        self._engine = engine
        self._exact = exact_odometry
        self._odom_start: Pose2D | None = None
        publisher = rospy.Publisher
        self._odom = publisher("odom", Odometry, queue_size=1)
        self._tf = publisher("/tf", TFMessage, queue_size=20)
        self._scan = publisher("scan", LaserScan, queue_size=1)
        self._imu = publisher("rosbot/imu", Imu, queue_size=1)
        self._ranges: dict[str, rospy.Publisher] = {}
        for frame in [m.frame for m in engine.robot.description.ranges] if engine.has_robot else _RANGE_FRAMES:
            self._range_publisher(frame)
        self._joints = publisher("joint_states", JointState, queue_size=1)
        self._battery = publisher("battery", BatteryState, queue_size=1)
        self._rgb = publisher("camera/rgb/image_raw", Image, queue_size=1)
        self._rgb_info = publisher("camera/rgb/camera_info", CameraInfo, queue_size=1)
        self._depth = publisher("camera/depth/image_raw", Image, queue_size=1)
        self._depth_info = publisher("camera/depth/camera_info", CameraInfo, queue_size=1)
        self._cloud = publisher("camera/depth/points", PointCloud2, queue_size=1)
        by_base: list[Due] = [
            (rates.odometry, 0, self._send_odometry),
            (rates.imu, 2, self._send_imu),
            (rates.range, 3, self._send_ranges),
            (rates.joints, 1, self._send_joints),
            (rates.battery, 7, self._send_battery),
        ]
        self.due: list[Due] = [
            *((rate, offset, self._unless_cut_off(send)) for rate, offset, send in by_base),
            (rates.scan, 0, self._send_scan),
            (rates.camera, 5, self._send_pictures),
        ]

    def _unless_cut_off(self, send: Callable[[float], None]) -> Callable[[float], None]:
        """The sender, but for a base whose cable is pulled."""
        return lambda now: None if self._engine.faults.is_silent("base") else send(now)

    def _odometry_now(self) -> tuple[Pose2D, Twist2D]:
        if not self._exact:
            odometry = self._engine.robot.odometry
            return odometry.pose, odometry.twist
        if self._odom_start is None:
            self._odom_start = self._engine.robot.start
        return compose(invert(self._odom_start), self._engine.pose), self._engine.twist

    def _send_odometry(self, now: float) -> None:
        pose, twist = self._odometry_now()
        base = self._engine.robot.description.base
        self._tf.publish(TFMessage([transform_to_msg(pose, "odom", base, now)]))
        if self._odom.get_num_connections():
            self._odom.publish(messages.odometry_msg(pose, twist, now, "odom", child=base, exact=self._exact))

    def _send_scan(self, now: float) -> None:
        if self._engine.robot.description.laser is None or not self._scan.get_num_connections():
            return
        if self._engine.faults.is_silent("lidar"):
            return
        lidar = self._engine.params.lidar
        message = scan_to_msg(replace(self._engine.scan(), stamp=now))
        message.scan_time = lidar.sweep_time
        message.time_increment = lidar.sweep_time / lidar.samples
        self._scan.publish(message)

    def _send_imu(self, now: float) -> None:
        mount = self._engine.robot.description.imu
        if mount is not None and self._imu.get_num_connections():
            self._imu.publish(messages.imu_msg(self._engine.imu(), self._engine.params.imu, now, mount.frame))

    def _send_ranges(self, now: float) -> None:
        wanted = [f for f in self._range_frames() if self._range_publisher(f).get_num_connections()]
        if not wanted:
            return
        distances = self._engine.ranges()
        for frame in wanted:
            message = messages.range_msg(distances[frame], self._engine.params.range, now, frame)
            self._ranges[frame].publish(message)

    def _range_frames(self) -> list[str]:
        return [mount.frame for mount in self._engine.robot.description.ranges]

    def _range_publisher(self, frame: str) -> rospy.Publisher:
        if frame not in self._ranges:
            topic = f"range/{frame.removeprefix('range_').removesuffix('_range')}"
            self._ranges[frame] = rospy.Publisher(topic, Range, queue_size=1)
        return self._ranges[frame]

    def _send_joints(self, now: float) -> None:
        if self._joints.get_num_connections():
            angles, speeds = self._engine.robot.wheels
            self._joints.publish(messages.joints_msg(self._engine.robot.description, angles, speeds, now))

    def _send_battery(self, now: float) -> None:
        if self._battery.get_num_connections():
            base = self._engine.robot.description.base
            self._battery.publish(messages.battery_msg(self._engine.robot.battery, now, base))

    def _send_pictures(self, now: float) -> None:
        mount = self._engine.robot.description.camera
        if mount is None or self._engine.faults.is_silent("camera"):
            return
        camera, frame = self._engine.params.camera.intrinsics, mount.frame
        for info in (self._rgb_info, self._depth_info):
            if info.get_num_connections():
                info.publish(messages.camera_info_msg(camera, now, frame))
        wanted = [p.get_num_connections() > 0 for p in (self._rgb, self._depth, self._cloud)]
        if not any(wanted):
            return
        picture = self._engine.picture(colour=wanted[0] or wanted[2], depth=wanted[1] or wanted[2])
        if wanted[0]:
            self._rgb.publish(messages.image_msg(picture.colour, "rgb8", now, frame))
        if wanted[1]:
            self._depth.publish(messages.image_msg(picture.depth, "32FC1", now, frame))
        if wanted[2]:
            self._cloud.publish(messages.cloud_msg(picture.colour, picture.depth, camera, now, frame))
