"""Conversion between a camera's calibration and sensor_msgs/CameraInfo."""

from __future__ import annotations

from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from rosbot_patrol.drivers.cameras.calibration import Calibration


def calibration_from_msg(msg: CameraInfo, name: str) -> Calibration:
    """The calibration in a message, of a camera of this name."""
    return Calibration(
        width=msg.width,
        height=msg.height,
        name=name,
        model=msg.distortion_model,
        d=tuple(msg.D),
        k=tuple(msg.K),
        r=tuple(msg.R),
        p=tuple(msg.P),
    )


def calibration_to_msg(calibration: Calibration, header: Header) -> CameraInfo:
    """Message of a calibration, with this header."""
    c = calibration
    return CameraInfo(
        header=header, width=c.width, height=c.height, distortion_model=c.model, D=c.d, K=c.k, R=c.r, P=c.p
    )
