"""Decoding of ROS 1 messages from their bytes, several times faster than with a general deserialiser.

For message types that come by the thousand, and for those of an action: their dozen nested types would need a new
deserialiser for each opened bag. Only definitions with the md5 sums below are decoded here; rosbags reads all other
messages, and all of ROS 2.
"""

from __future__ import annotations

import math
import struct

import numpy as np

from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge

SCAN_MD5 = "90c7ef2dc6895d81024acba2ac42f369"  # sensor_msgs/LaserScan
TF_MD5 = "94810edda583a504dfda3829e70d7eec"  # tf2_msgs/TFMessage and tf/tfMessage
COUNT_MD5 = "123675bf4420958597b5a78cb3800a1f"  # darknet_ros_msgs/ObjectCount
GOAL_MD5 = "660d6895a1b9a16dce51fbdd9a64a56b"  # move_base_msgs/MoveBaseActionGoal
IMAGE_MD5 = "060021388200f6f0f447d0fcd9c64743"  # sensor_msgs/Image
RESULT_MD5 = "1eb06eeff08fa7ea874431638cb52332"  # move_base_msgs/MoveBaseActionResult

_HEADER = struct.Struct("<IIII")  # seq, seconds, nanoseconds, length of the frame's name
_BEAMS = struct.Struct("<7fI")  # angle_min, angle_max, angle_increment, time_increment, scan_time, range_min, range_max
_COUNT, _INT8, _UINT8, _TIME = struct.Struct("<I"), struct.Struct("<b"), struct.Struct("<B"), struct.Struct("<II")
_SIZE, _ROWS = struct.Struct("<II"), struct.Struct("<BII")  # of an image: height, width; byte order, step, length
_TRANSFORM = struct.Struct("<7d")  # x, y, z and the quaternion


def read_scan(raw: bytes) -> LaserScan:
    """Decode a sensor_msgs/LaserScan; a stamp of 0 means none (NaN).

    Raises:
        struct.error, ValueError: the bytes end too early.
    """
    _, seconds, nanoseconds, length = _HEADER.unpack_from(raw)
    at = _HEADER.size + length
    frame = raw[_HEADER.size : at].decode()
    angle_min, _, increment, _, _, range_min, range_max, count = _BEAMS.unpack_from(raw, at)
    ranges = np.frombuffer(raw, dtype="<f4", count=count, offset=at + _BEAMS.size).astype(np.float64)
    return LaserScan(
        stamp=(seconds + nanoseconds / 1e9) or math.nan,
        frame_id=frame.lstrip("/"),
        angle_min=angle_min,
        angle_increment=increment,
        range_min=range_min,
        range_max=range_max,
        ranges=ranges,
    )


def read_count(raw: bytes) -> tuple[float, int]:
    """Decode a darknet_ros_msgs/ObjectCount: the picture's time [s], and its number of objects.

    Raises:
        struct.error: the bytes end too early.
    """
    _, seconds, nanoseconds, length = _HEADER.unpack_from(raw)
    return seconds + nanoseconds / 1e9, _INT8.unpack_from(raw, _HEADER.size + length)[0]


def read_image(raw: bytes) -> tuple[float, int, int, str, bool, int, memoryview]:
    """Decode a sensor_msgs/Image: time [s], height and width [px], encoding, is big-endian, bytes of a row, all rows.

    Raises:
        struct.error, ValueError: the bytes end too early or the encoding is not text.
    """
    _, seconds, nanoseconds, length = _HEADER.unpack_from(raw)
    at = _HEADER.size + length
    height, width = _SIZE.unpack_from(raw, at)
    encoding, at = _text(raw, at + _SIZE.size)
    is_big_endian, step, size = _ROWS.unpack_from(raw, at)
    at += _ROWS.size
    if at + size > len(raw):
        raise struct.error(f"a picture of {size} bytes does not fit into {len(raw) - at}")
    data = memoryview(raw)[at : at + size]
    return seconds + nanoseconds / 1e9, height, width, encoding, bool(is_big_endian), step, data


def read_goal(raw: bytes) -> str:
    """Decode the id of a move_base_msgs/MoveBaseActionGoal.

    Raises:
        struct.error, ValueError: the bytes end too early or the id is not text.
    """
    return _goal_id(raw)[0]


def read_result(raw: bytes) -> tuple[str, int, str]:
    """Decode a move_base_msgs/MoveBaseActionResult: goal id, status (actionlib_msgs/GoalStatus), status text.

    Raises:
        struct.error, ValueError: the bytes end too early or the texts are invalid.
    """
    goal, at = _goal_id(raw)
    (status,) = _UINT8.unpack_from(raw, at)
    text, _ = _text(raw, at + _UINT8.size)
    return goal, status, text


def _goal_id(raw: bytes) -> tuple[str, int]:
    """Text of the actionlib_msgs/GoalID behind the header, and its end."""
    *_, length = _HEADER.unpack_from(raw)
    return _text(raw, _HEADER.size + length + _TIME.size)


def _text(raw: bytes, at: int) -> tuple[str, int]:
    """A string at an offset, and its end."""
    (length,) = _COUNT.unpack_from(raw, at)
    at += _COUNT.size
    if at + length > len(raw):
        raise struct.error(f"a text of {length} bytes does not fit into {len(raw) - at}")
    return raw[at : at + length].decode(), at + length


def read_transforms(raw: bytes) -> list[Edge]:
    """Decode a tf2_msgs/TFMessage.

    Raises:
        struct.error, ValueError: the bytes end too early or a name is not text.
    """
    edges, at = [], _COUNT.size
    for _ in range(_COUNT.unpack_from(raw)[0]):
        _, seconds, nanoseconds, length = _HEADER.unpack_from(raw, at)
        at += _HEADER.size
        parent = raw[at : at + length].decode()
        at += length
        (length,) = _COUNT.unpack_from(raw, at)
        at += _COUNT.size
        child = raw[at : at + length].decode()
        at += length
        edges.append(Edge(parent, child, seconds + nanoseconds / 1e9, *_TRANSFORM.unpack_from(raw, at)))
        at += _TRANSFORM.size
    return edges
