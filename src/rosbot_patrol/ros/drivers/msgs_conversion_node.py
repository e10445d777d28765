"""msgs_conversion: what the ROSbot's firmware sends, as messages that the filter reads.

Matches rosbot_ekf: `pose` (PoseStamped) becomes `odom/wheel` (Odometry) with a variance of 0.005 for each number of the
pose; `mpu9250` of firmware before 0.14.4 (degrees a second, g) becomes `imu` (SI units).
"""

from __future__ import annotations

import math

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from rosbot_patrol.ros.runtime.node import run_node

_POSE_VARIANCE = 0.005
_G = 9.8066  # [m/s^2], as upstream's
_VARIANCES = (0.05, 0.1, 0.5)  # of orientation, turning speed, acceleration


class MsgsConversion:
    """Two subscribers and their publishers."""

    def __init__(self, tf_prefix: str) -> None:
        from rosbot_ekf.msg import Imu as OldImu  # built from drop_in/rosbot_ekf, after this package

        self._odom_frame = f"{tf_prefix}/odom" if tf_prefix else "odom"
        self._imu_frame = f"{tf_prefix}/imu_link" if tf_prefix else "imu_link"
        self._odometry = rospy.Publisher("odom/wheel", Odometry, queue_size=1)
        self._imu: rospy.Publisher | None = None
        rospy.Subscriber("pose", PoseStamped, self._on_pose, queue_size=1000)
        rospy.Subscriber("mpu9250", OldImu, self._on_imu, queue_size=1000)

    def _on_pose(self, pose: PoseStamped) -> None:
        message = Odometry(header=pose.header)
        message.header.frame_id = self._odom_frame
        message.pose.pose = pose.pose
        message.pose.covariance = (np.eye(6) * _POSE_VARIANCE).ravel().tolist()
        self._odometry.publish(message)

    def _on_imu(self, old: object) -> None:
        if self._imu is None:  # newer firmware publishes imu itself
            self._imu = rospy.Publisher("imu", Imu, queue_size=1)
        message = Imu(header=old.header, orientation=old.orientation)  # type: ignore[attr-defined]
        message.header.frame_id = self._imu_frame
        turning, linear = message.angular_velocity, message.linear_acceleration
        turning.x, turning.y, turning.z = (math.radians(each) for each in old.angular_velocity)  # type: ignore[attr-defined]
        linear.x, linear.y, linear.z = (each * _G for each in old.linear_acceleration)  # type: ignore[attr-defined]
        spreads = [(np.eye(3) * each).ravel().tolist() for each in _VARIANCES]
        message.orientation_covariance, message.angular_velocity_covariance = spreads[:2]
        message.linear_acceleration_covariance = spreads[2]
        self._imu.publish(message)


def _body() -> None:
    MsgsConversion(str(rospy.get_param("~tf_prefix", "")))
    rospy.spin()


def main() -> None:
    """Run the node."""
    run_node("msgs_conversion", _body)
