"""The messages of a ROSbot's firmware, serialised as ROS 1 does, without message classes.

Source: Husarion's rosbot-stm32-firmware 0.16.2 (what it sends), the definitions of geometry_msgs and sensor_msgs.
"""

from __future__ import annotations

import math
import struct

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.topics import TopicInfo

# name: type, MD5 sum of its definition
TYPES = {
    "pose": ("geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5"),
    "velocity": ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
    "cmd_vel": ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
    "imu": ("sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    "mpu9250": ("rosbot_ekf/Imu", "3d83bdcabfe2927ed38c36f102a9f646"),
    "battery": ("sensor_msgs/BatteryState", "4ddae7f048e32fda22cac764685e3974"),
    "range": ("sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
}
CONFIG = (
    "rosbot_ekf/Configuration",
    "b116973260063b7b02b501a288810d3d",  # of the request
    "d26ad64e1f52355ee24245b602a171ba",  # of the response
)
_G = 9.8066
_LION = 2
_INFRARED = 1


def topic(number: int, name: str, kind: str = "") -> TopicInfo:
    """The announcement of a topic, of the kind of its own name or of another's."""
    message_type, md5 = TYPES[kind or name]
    return TopicInfo(topic_id=number, name=name, message_type=message_type, md5=md5)


def text(value: str) -> bytes:
    """A text with its length."""
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def header(frame: str, stamp: float) -> bytes:
    """A header with a time [s]."""
    seconds = int(stamp)
    return struct.pack("<III", 0, seconds, int((stamp - seconds) * 1e9)) + text(frame)


def pose(x: float, y: float, yaw: float, stamp: float) -> bytes:
    """A pose in the frame odom."""
    return header("odom", stamp) + struct.pack("<7d", x, y, 0.0, *_turn(yaw))


def twist(linear: tuple[float, float], turning: float) -> bytes:
    """Speeds: x and y [m/s], yaw [rad/s]."""
    return struct.pack("<6d", *linear, 0.0, 0.0, 0.0, turning)


def read_twist(data: bytes) -> tuple[float, float]:
    """Forward speed [m/s] and turning speed [rad/s] of a command."""
    values = struct.unpack("<6d", data)
    return values[0], values[5]


def imu(yaw: float, turning: float, stamp: float) -> bytes:
    """An IMU that lies level: orientation, turning, gravity; variances as the firmware's."""

    def spread(variance: float) -> tuple[float, ...]:
        return tuple(variance if at % 4 == 0 else 0.0 for at in range(9))

    return b"".join(
        (
            header("imu_link", stamp),
            struct.pack("<4d", *_turn(yaw)),
            struct.pack("<9d", *spread(0.05)),
            struct.pack("<3d", 0.0, 0.0, turning),
            struct.pack("<9d", *spread(0.1)),
            struct.pack("<3d", 0.0, 0.0, _G),
            struct.pack("<9d", *spread(0.5)),
        )
    )


def old_imu(yaw: float, turning: float, stamp: float) -> bytes:
    """The IMU of firmware before 0.14.4: degrees a second, g."""
    numbers = (0.0, 0.0, math.degrees(turning), 0.0, 0.0, 1.0)
    return header("imu_link", stamp) + struct.pack("<4d", *_turn(yaw)) + struct.pack("<6f", *numbers)


def battery(voltage: float) -> bytes:
    """The battery: voltage alone, all else 0 and no stamp, as the firmware leaves it."""
    numbers = struct.pack("<7f", voltage, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return header("", 0.0) + numbers + struct.pack("<4B", 0, 0, _LION, 0) + struct.pack("<2I", 0, 0) + text("") * 2


def distance(frame: str, metres: float, stamp: float) -> bytes:
    """One range sensor; -1 where it is broken."""
    return header(frame, stamp) + struct.pack("<Bffff", _INFRARED, 0.26, 0.03, 0.90, metres)


def read_config(data: bytes) -> tuple[str, str]:
    """Command and data of a request of the service config. Raises ProtocolError."""
    found, at = [], 0
    for _ in range(2):
        end = at + 4 + int.from_bytes(data[at : at + 4], "little")
        if end > len(data):
            raise ProtocolError("", f"a request of {len(data)} bytes ends too early")
        found.append(data[at + 4 : end].decode("utf-8", "replace"))
        at = end
    return found[0], found[1]


def config_answer(data: str, result: int) -> bytes:
    """An answer of the service config."""
    return text(data) + bytes((result,))


def _turn(yaw: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)
