"""ekf_localization_node: one estimate of the robot's motion from wheels, IMU and other sensors.

Matches robot_localization 2.7 (ROS 1): parameters, `odometry/filtered`, `accel/filtered`, transform, `set_pose` (topic
and service), `~toggle`, `~enable`, /diagnostics.

Differs:
- Left out: smooth_lagged_data (late measurements correct the present), `_pose_use_child_frame`, transform_timeout
  (look-ups never wait), the nodes ukf_localization_node and navsat_transform_node.
- A sensor that is silent, late, rejected or without a transform is named on /diagnostics, with its numbers.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Mapping

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import (
    AccelWithCovarianceStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
    Twist,
    TwistStamped,
)
from nav_msgs.msg import Odometry
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from rosbot_patrol.ekf.core import Counts, FilterCore, unmeasured
from rosbot_patrol.ekf.params import EkfParams, InputParams, read_inputs, sensor_keys
from rosbot_patrol.ekf.readings import Frame
from rosbot_patrol.ekf.sensor import Surroundings
from rosbot_patrol.ekf.state import (
    ACCELERATION,
    ORIENTATION,
    POSE,
    POSITION,
    TURNING,
    TWIST,
    VELOCITY,
    angles,
    rotation,
    to_quaternion,
)
from rosbot_patrol.errors import TransformError
from rosbot_patrol.ros.drivers import ekf_inputs
from rosbot_patrol.ros.messages.convert import time_to_msg
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, WARN, Health
from rosbot_patrol.ros.runtime.node import Loop, load_params, now, run_node
from rosbot_patrol.ros.runtime.process import Priority
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

_SILENT = 2.0  # [s]
_REPORT = 1.0  # [s]
_JUMP = 10.0  # [s] back in time


class EkfNode:
    """Callbacks queue readings; one loop takes them, and publishes the estimate."""

    def __init__(self, params: EkfParams, inputs: Mapping[str, InputParams]) -> None:
        self._params = params
        self._transforms = Transforms()
        self._lock = threading.Lock()
        configs = {name: each.sensor(name) for name, each in inputs.items()}
        around = Surroundings(
            world=params.world,
            base=params.base_link_frame,
            lookup=self._lookup,
            is_planar=params.two_d_mode,
            gravity=params.gravitational_acceleration,
        )
        self._core = FilterCore(params.ekf(), configs, around, params.silence)
        self._unmeasured = unmeasured(configs, is_planar=params.two_d_mode)
        self._is_on = not params.disabled_at_startup
        self._counted: dict[str, Counts] = {}
        self._published = -math.inf
        self._last = -math.inf
        self._reported = -math.inf
        self._health = Health() if params.print_diagnostics else None
        self._odometry = rospy.Publisher("odometry/filtered", Odometry, queue_size=20)
        self._acceleration = (
            rospy.Publisher("accel/filtered", AccelWithCovarianceStamped, queue_size=20)
            if params.publish_acceleration
            else None
        )
        self._broadcaster = tf2_ros.TransformBroadcaster()
        for name, each in inputs.items():
            ekf_inputs.subscribe(name, each, self._hear)
        if params.use_control:
            kind = TwistStamped if params.stamped_control else Twist
            rospy.Subscriber("cmd_vel", kind, self._on_control, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("set_pose", PoseWithCovarianceStamped, self._on_pose, queue_size=1)
        self._offer_services()
        for name, config in configs.items():
            if config.is_differential and inputs[name].relative:
                log.warning("%s is both differential and relative: differential wins", name)
        if params.smooth_lagged_data:
            log.warning("smooth_lagged_data is not built: late measurements correct the present")

    def step(self, current: float) -> None:
        """Take what has come, and publish."""
        with self._lock:
            if current < self._last - _JUMP and self._params.reset_on_time_jump:
                log.warning("ROS time went back by %.1f s: the filter begins anew", self._last - current)
                self._core.forget()
                self._published = -math.inf
            self._last = current
            if self._is_on:
                self._estimate(current)
        if self._health is not None and not 0.0 <= current - self._reported < _REPORT:
            self._reported = current
            self._report(current)

    def _estimate(self, current: float) -> None:
        self._core.update(current, to_now=self._params.predict_to_current_time)
        ekf = self._core.ekf
        is_new = ekf.stamp > self._published or self._params.permit_corrected_publication
        if ekf.is_begun and is_new and np.isfinite(ekf.state).all():
            self._published = ekf.stamp
            self._publish()

    # -- inputs

    def _hear(self, name: str, readings: list[ekf_inputs.Reading]) -> None:
        with self._lock:
            if self._is_on:
                for reading in readings:
                    self._core.hear(name, reading)

    def _on_control(self, message: Twist | TwistStamped) -> None:
        stamp = message.header.stamp.to_sec() if self._params.stamped_control else now()
        speed = message.twist if self._params.stamped_control else message
        command = np.array([getattr(part, axis) for part in (speed.linear, speed.angular) for axis in "xyz"])
        with self._lock:
            if self._core.ekf.control is not None and np.isfinite(command).all():
                self._core.ekf.control.hear(command, stamp)

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        reading = ekf_inputs.pose(message)
        frame = Frame()
        try:
            if reading.frame:
                frame = self._lookup(self._params.world, reading.frame, 0.0)
        except TransformError as err:
            log.error("the pose was not set: %s", err)
            return
        pose = frame @ reading.pose
        stamp = reading.stamp or now()
        with self._lock:
            self._core.set_pose(stamp, np.concatenate((pose.origin, angles(pose.rotation))), reading.covariance)
            self._published = -math.inf
        log.info("the pose was set to (%.2f, %.2f), %.2f rad", *pose.origin[:2], angles(pose.rotation)[2])

    def _offer_services(self) -> None:
        from robot_localization.srv import (  # built from drop_in/robot_localization, after this package
            SetPose,
            SetPoseResponse,
            ToggleFilterProcessing,
            ToggleFilterProcessingResponse,
        )

        def set_pose(request: object) -> object:
            self._on_pose(request.pose)  # type: ignore[attr-defined]
            return SetPoseResponse()

        def toggle(request: object) -> object:
            is_on = bool(request.on)  # type: ignore[attr-defined]
            is_changed, self._is_on = is_on != self._is_on, is_on
            if not is_changed:
                log.warning("the filter is %s already", "on" if is_on else "off")
            return ToggleFilterProcessingResponse(is_changed)

        rospy.Service("set_pose", SetPose, set_pose)
        rospy.Service("~toggle", ToggleFilterProcessing, toggle)
        rospy.Service("~enable", Empty, self._enable)

    def _enable(self, _: EmptyRequest) -> EmptyResponse:
        self._is_on = True
        return EmptyResponse()

    def _lookup(self, target: str, source: str, stamp: float) -> Frame:
        """Pose of a frame in another, at a time or else the newest."""
        if target == source:
            return Frame()
        try:
            matrix = self._transforms.lookup_matrix(target, source, stamp)
        except TransformError:
            matrix = self._transforms.lookup_matrix(target, source, 0.0)
        return Frame(matrix[:3, :3], matrix[:3, 3])

    # -- outputs

    def _publish(self) -> None:
        ekf, p = self._core.ekf, self._params
        state, covariance = ekf.state, ekf.covariance
        message = Odometry()
        message.header.stamp, message.header.frame_id = time_to_msg(ekf.stamp), p.world
        message.child_frame_id = p.base_link_frame_output or p.base_link_frame
        place = message.pose.pose
        place.position.x, place.position.y, place.position.z = state[POSITION].tolist()
        q = place.orientation
        q.x, q.y, q.z, q.w = to_quaternion(*state[ORIENTATION].tolist())
        message.pose.covariance = covariance[POSE, POSE].ravel().tolist()
        speed = message.twist.twist
        speed.linear.x, speed.linear.y, speed.linear.z = state[VELOCITY].tolist()
        speed.angular.x, speed.angular.y, speed.angular.z = state[TURNING].tolist()
        message.twist.covariance = covariance[TWIST, TWIST].ravel().tolist()
        self._odometry.publish(message)
        if p.publish_tf:
            self._send_transform(message)
        if self._acceleration is not None:
            self._publish_acceleration(message)

    def _send_transform(self, message: Odometry) -> None:
        """The base in the world frame; where that is the map, the odometry's frame in the map."""
        p, state = self._params, self._core.ekf.state
        pose = Frame(rotation(*state[ORIENTATION].tolist()), state[POSITION])
        parent, child = p.world, message.child_frame_id
        if p.world == p.map_frame:
            try:
                pose = pose @ self._lookup(p.base_link_frame, p.odom_frame, 0.0)
            except TransformError as err:
                rospy.logwarn_throttle(10.0, "no transform is published: %s", err)
                return
            child = p.odom_frame
        if p.invert_tf:
            pose, parent, child = pose.inverse, child, parent
        sent = TransformStamped()
        sent.header.frame_id, sent.child_frame_id = parent, child
        sent.header.stamp = time_to_msg(self._core.ekf.stamp + p.transform_time_offset)
        move, turn = sent.transform.translation, sent.transform.rotation
        move.x, move.y, move.z = pose.origin.tolist()
        turn.x, turn.y, turn.z, turn.w = to_quaternion(*angles(pose.rotation))
        self._broadcaster.sendTransform(sent)

    def _publish_acceleration(self, odometry: Odometry) -> None:
        message = AccelWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = odometry.header.stamp, odometry.child_frame_id
        linear = message.accel.accel.linear
        linear.x, linear.y, linear.z = self._core.acceleration().tolist()
        spread = np.zeros((6, 6))
        spread[:3, :3] = self._core.ekf.covariance[ACCELERATION, ACCELERATION]
        message.accel.covariance = spread.ravel().tolist()
        assert self._acceleration is not None
        self._acceleration.publish(message)

    def _report(self, current: float) -> None:
        assert self._health is not None
        with self._lock:
            silent = self._core.silent(current)
            counts = {name: Counts(**vars(each)) for name, each in self._core.counts.items()}
            is_begun = self._core.ekf.is_begun
        for name, each in counts.items():
            level, text = _judge(silent[name], each, self._counted.get(name, Counts()))
            self._health.set(name, level, text, {**vars(each), "silent for [s]": f"{silent[name]:.1f}"})
        self._counted = counts
        problems = [f"{each} is not measured: its error grows without bound" for each in self._unmeasured]
        if not self._is_on:
            problems = ["switched off: call the service ~enable"]
        elif not is_begun:
            problems.insert(0, "nothing was measured yet")
        self._health.set("", WARN if problems else OK, "; ".join(problems) or "estimates")


def _judge(silent: float, counts: Counts, before: Counts) -> tuple[int, str]:
    if counts.lost and not counts.taken:
        return ERROR, f"its readings cannot be placed: {counts.problem}"
    if math.isinf(silent):
        return ERROR, "was never heard"
    if silent > _SILENT:
        return WARN, f"silent for {silent:.1f} s"
    if counts.late > before.late and counts.taken == before.taken:
        return WARN, "its stamps have gone back: readings older than the last do not count (reset_on_time_jump)"
    if counts.spoilt > before.spoilt:
        return WARN, "it sends numbers that are not finite: they do not count"
    if counts.unspread > before.unspread:
        return WARN, "it sends a covariance of 0, which counts as 1e-9: set it in the driver"
    if counts.rejected > counts.taken:
        return WARN, "most of its readings are too far off and rejected"
    return OK, "heard"


def body() -> None:
    """Run until shutdown."""
    tree = rospy.get_param("~", {}) or {}
    inputs = read_inputs(tree, name=rospy.get_name() + "/")
    params = load_params(EkfParams, tree=tree, ignore=sensor_keys(tree))
    if not inputs:
        log.warning("no sensor is configured (odom0, pose0, twist0, imu0): there will be no estimate")
    node = EkfNode(params, inputs)
    Loop(params.frequency, node.step).run()


def main() -> None:
    """Run the node."""
    run_node("ekf_localization", body, priority=Priority.CONTROL)
