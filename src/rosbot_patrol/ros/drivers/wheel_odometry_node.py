"""wheel_odometry: /odom and odom -> base_link from the ticks of two wheels, such as an Arduino sends over rosserial."""

from __future__ import annotations

import logging
import math
import threading
import time
from dataclasses import dataclass

import numpy as np
import rospy
from nav_msgs.msg import Odometry
from std_msgs.msg import Int16, Int32
from tf2_msgs.msg import TFMessage

from rosbot_patrol.drivers.bases.ticks import TicksOdometry, WheelParams
from rosbot_patrol.params import param
from rosbot_patrol.ros.messages.convert import pose2d_to_pose, transform_to_msg
from rosbot_patrol.ros.runtime import diagnostics
from rosbot_patrol.ros.runtime.node import load_params, run_node

log = logging.getLogger(__name__)

_POSE_VARIANCES = (1e-3, 1e-3, 1e6, 1e6, 1e6, 1e-2)
_TWIST_VARIANCES = (1e-3, 1e-6, 1e6, 1e6, 1e6, 1e-2)


@dataclass(frozen=True, kw_only=True)
class WheelOdometryParams(WheelParams):
    """Parameters of wheel_odometry."""

    message: str = param("Int32", choices=("Int16", "Int32"), doc="type of both topics of ticks (std_msgs)")
    odom_frame: str = param("odom", doc="frame of the odometry")
    base_frame: str = param("base_link", doc="frame of the base")
    publish_tf: bool = param(True, doc="publish the transform; false where a filter publishes it")
    timeout: float = param(1.0, unit="s", lo=0.1, doc="silence after which the base counts as cut off")


class WheelOdometry:
    """Two counters in, odometry out; both are read together when each has come anew, in whatever order."""

    def __init__(self, params: WheelOdometryParams) -> None:
        self._params, self._odometry = params, TicksOdometry(params)
        self._lock = threading.Lock()  # each topic has a thread
        self._ticks: dict[str, int] = {}
        self._heard = -math.inf
        self._publisher = rospy.Publisher("odom", Odometry, queue_size=10)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10) if params.publish_tf else None
        self._health = diagnostics.Health(hardware_id="wheels")
        kind = {"Int16": Int16, "Int32": Int32}[params.message]
        rospy.Subscriber("left_ticks", kind, lambda m: self._on_ticks("left", m), queue_size=10, tcp_nodelay=True)
        rospy.Subscriber("right_ticks", kind, lambda m: self._on_ticks("right", m), queue_size=10, tcp_nodelay=True)

    def run(self) -> None:
        """Watch over the base until shutdown."""
        was_silent = False
        while not rospy.is_shutdown():
            silent = time.monotonic() - self._heard > self._params.timeout
            text = "no ticks come: look at the base's cable and bridge" if silent else "ticks come"
            if silent and not was_silent:
                log.error("%s", text)
            was_silent = silent
            level = diagnostics.ERROR if silent else diagnostics.OK
            self._health.set("", level, text, {"restarts of the counters": self._odometry.restarts})
            time.sleep(0.2)

    def _on_ticks(self, side: str, message: Int16 | Int32) -> None:
        with self._lock:
            self._ticks[side] = message.data
            if len(self._ticks) == 2:
                self._update(self._ticks.pop("left"), self._ticks.pop("right"))

    def _update(self, left: int, right: int) -> None:
        self._heard = time.monotonic()
        stamp = rospy.Time.now()
        restarts = self._odometry.restarts
        self._odometry.update(left, right, stamp.to_sec())
        if self._odometry.restarts > restarts:
            log.warning("the counters of the wheels have jumped: the base has restarted, or `fastest` is too small")
        self._publish(stamp)

    def _publish(self, stamp: rospy.Time) -> None:
        p, pose, twist = self._params, self._odometry.pose, self._odometry.twist
        message = Odometry(child_frame_id=p.base_frame)
        message.header.stamp, message.header.frame_id = stamp, p.odom_frame
        message.pose.pose = pose2d_to_pose(pose)
        message.twist.twist.linear.x, message.twist.twist.angular.z = twist.vx, twist.wz
        message.pose.covariance = np.diag(_POSE_VARIANCES).ravel().tolist()
        message.twist.covariance = np.diag(_TWIST_VARIANCES).ravel().tolist()
        self._publisher.publish(message)
        if self._tf is not None:
            self._tf.publish(TFMessage([transform_to_msg(pose, p.odom_frame, p.base_frame, stamp.to_sec())]))


def _body() -> None:
    WheelOdometry(load_params(WheelOdometryParams)).run()


def main() -> None:
    """Run the node."""
    run_node("wheel_odometry", _body)
