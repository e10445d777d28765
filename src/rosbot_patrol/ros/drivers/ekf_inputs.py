"""Messages of odometry, poses, speeds and IMUs as readings of the filter."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from rosbot_patrol.ekf.params import InputParams
from rosbot_patrol.ekf.readings import AccelerationReading, Frame, PoseReading, TwistReading
from rosbot_patrol.ekf.state import Array, from_quaternion

Reading = PoseReading | TwistReading | AccelerationReading
Heard = Callable[[str, list[Reading]], None]

_UNKNOWN = -1.0  # first covariance of an IMU's part that it does not measure
_NOT_A_UNIT = 0.01


def subscribe(name: str, inputs: InputParams, heard: Heard) -> rospy.Subscriber:
    """Listen to a sensor by the kind that its name says."""
    kind = name.rstrip("0123456789")
    message, convert = {
        "odom": (Odometry, odometry),
        "pose": (PoseWithCovarianceStamped, _poses),
        "twist": (TwistWithCovarianceStamped, twist),
        "imu": (Imu, imu),
    }[kind]
    callback = partial(_pass_on, name, convert, heard)
    return rospy.Subscriber(
        inputs.topic, message, callback, queue_size=inputs.queue_size, tcp_nodelay=inputs.nodelay or kind == "imu"
    )


def _pass_on(name: str, convert: Callable[[object], list[Reading]], heard: Heard, message: object) -> None:
    heard(name, convert(message))


def odometry(message: Odometry) -> list[Reading]:
    """Pose in the frame of the header, speeds in the child's."""
    stamp = message.header.stamp.to_sec()
    place = _frame(message.pose.pose)
    speed = message.twist.twist
    child = message.child_frame_id.lstrip("/")
    return [
        PoseReading(stamp, message.header.frame_id.lstrip("/"), place, _six(message.pose.covariance)),
        TwistReading(stamp, child, _xyz(speed.linear), _xyz(speed.angular), _six(message.twist.covariance)),
    ]


def pose(message: PoseWithCovarianceStamped) -> PoseReading:
    """Pose in the frame of the header."""
    stamp, frame = message.header.stamp.to_sec(), message.header.frame_id.lstrip("/")
    return PoseReading(stamp, frame, _frame(message.pose.pose), _six(message.pose.covariance))


def _poses(message: PoseWithCovarianceStamped) -> list[Reading]:
    return [pose(message)]


def twist(message: TwistWithCovarianceStamped) -> list[Reading]:
    """Speeds in the frame of the header."""
    speed = message.twist.twist
    stamp, frame = message.header.stamp.to_sec(), message.header.frame_id.lstrip("/")
    return [TwistReading(stamp, frame, _xyz(speed.linear), _xyz(speed.angular), _six(message.twist.covariance))]


def imu(message: Imu) -> list[Reading]:
    """Orientation, turning speeds and accelerations, as far as the IMU measures them."""
    stamp, frame = message.header.stamp.to_sec(), message.header.frame_id.lstrip("/")
    has_orientation = message.orientation_covariance[0] != _UNKNOWN
    own = _rotation(message.orientation) if has_orientation else None
    found: list[Reading] = []
    if own is not None:
        spread = _lower(message.orientation_covariance)
        found.append(PoseReading(stamp, frame, Frame(own), spread, is_orientation=True))
    if message.angular_velocity_covariance[0] != _UNKNOWN:
        spread = _lower(message.angular_velocity_covariance)
        found.append(TwistReading(stamp, frame, np.zeros(3), _xyz(message.angular_velocity), spread))
    if message.linear_acceleration_covariance[0] != _UNKNOWN:
        spread = np.array(message.linear_acceleration_covariance).reshape(3, 3)
        found.append(AccelerationReading(stamp, frame, _xyz(message.linear_acceleration), spread, own))
    return found


def _frame(place: object) -> Frame:
    return Frame(_rotation(place.orientation), _xyz(place.position))  # type: ignore[attr-defined]


def _rotation(q: object) -> Array:
    """The rotation of a quaternion; one of zeros counts as none, another length is made 1."""
    x, y, z, w = (float(getattr(q, name)) for name in "xyzw")
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if norm == 0.0:
        rospy.logwarn_throttle(60.0, "an orientation has only zeros: it counts as no rotation")
        return np.eye(3)
    if abs(norm - 1.0) > _NOT_A_UNIT:
        rospy.logwarn_throttle(60.0, "an orientation has the length %.3f in place of 1: it is made 1", norm)
    return from_quaternion(x / norm, y / norm, z / norm, w / norm)


def _xyz(value: object) -> Array:
    return np.array([float(getattr(value, name)) for name in "xyz"])


def _six(values: object) -> Array:
    return np.array(values, float).reshape(6, 6)


def _lower(values: object) -> Array:
    """A covariance of three angles as the lower right part of one of a pose."""
    spread = np.zeros((6, 6))
    spread[3:, 3:] = np.array(values, float).reshape(3, 3)
    return spread
