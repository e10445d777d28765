"""Outputs of amcl: pose, particles, map -> odom, and the health of the estimate."""

from __future__ import annotations

import math

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from numpy.typing import NDArray

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.particles.particle_filter import Estimate
from rosbot_patrol.amcl.trust import State, Trust
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.msg import LocalizationHealth
from rosbot_patrol.ros.messages.convert import pose2d_to_pose, time_to_msg, transform_to_msg
from rosbot_patrol.ros.messages.fast_arrays import pose_array_to_msg
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN


class AmclOutputs:
    """The published topics of amcl.

    Args:
        params: amcl's parameters; set anew when they change.
    """

    def __init__(self, params: AmclParams) -> None:
        self.params = params
        self._global = params.global_frame_id.lstrip("/")
        self._odom = params.odom_frame_id.lstrip("/")
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._pose = rospy.Publisher("amcl_pose", PoseWithCovarianceStamped, queue_size=2, latch=True)
        self._cloud = rospy.Publisher("particlecloud", PoseArray, queue_size=2, latch=True)
        self._health = rospy.Publisher("~health", LocalizationHealth, queue_size=2, latch=True)
        self._last_cloud = -math.inf

    def send_correction(self, correction: Pose2D, stamp: float) -> None:
        """Send map -> odom for a scan's stamp [s]."""
        if self.params.tf_broadcast:
            ahead = stamp + self.params.transform_tolerance
            self._broadcaster.sendTransform(transform_to_msg(correction, self._global, self._odom, ahead))

    def send_pose(self, estimate: Estimate, stamp: float) -> None:
        """Send the pose and its covariance."""
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.header.stamp = self._global, time_to_msg(stamp)
        message.pose.pose = pose2d_to_pose(estimate.pose)
        covariance = np.zeros((6, 6))
        covariance[np.ix_([0, 1], [0, 1])] = estimate.covariance[:2, :2]
        covariance[5, 5] = estimate.covariance[2, 2]
        message.pose.covariance = covariance.ravel().tolist()
        self._pose.publish(message)

    def send_cloud(self, poses: NDArray[np.float64], stamp: float) -> None:
        """Send the particles, shape (N, 3), at most at `gui_publish_rate`."""
        rate = self.params.gui_publish_rate
        if rate > 0.0 and 0.0 <= stamp - self._last_cloud < 1.0 / rate:
            return
        self._last_cloud = stamp
        self._cloud.publish(pose_array_to_msg(poses, self._global, stamp))

    def send_health(self, trust: Trust, estimate: Estimate | None, stamp: float, *, seeking: bool) -> None:
        """Send whether the estimate can be trusted."""
        message = LocalizationHealth(
            state=trust.state.name.lower(), belief=trust.belief, seeking=seeking, why=trust.reason
        )
        message.header.frame_id, message.header.stamp = self._global, time_to_msg(stamp)
        message.agreement = -1.0 if math.isnan(trust.agreement) else trust.agreement
        if estimate is not None:
            message.std_x, message.std_y, message.std_yaw = spread_of(estimate)
        self._health.publish(message)


def spread_of(estimate: Estimate) -> list[float]:
    """Standard deviations of x, y, yaw [m, m, rad]."""
    spread: list[float] = np.sqrt(np.maximum(np.diag(estimate.covariance), 0.0)).tolist()
    return spread


def verdict(trust: Trust, estimate: Estimate | None, params: AmclParams, *, seeking: bool) -> tuple[int, str]:
    """Level and sentence of /diagnostics for the current estimate."""
    if trust.state is State.LOST:
        action = "the whole map is searched" if seeking else "set an initial pose or call ~relocalize"
        return WARN, f"the robot is lost: {trust.reason}; {action}"
    if trust.state is State.UNSURE:
        return WARN, f"the pose is not sure: {trust.reason}"
    limits = (params.std_warn_level_x, params.std_warn_level_y, params.std_warn_level_yaw)
    if estimate is not None and any(s > limit for s, limit in zip(spread_of(estimate), limits, strict=True)):
        return WARN, "the pose is not sure: the particles are spread widely"
    if trust.state is State.UNKNOWN:
        return OK, f"localised, but unproven: {trust.reason}"
    return OK, "localised"
