"""Messages packed by numpy, without a Python object per cell or pose.

A map of 1984 x 1984 cells takes 3 ms over a topic or service this way, and 56 ms as rospy's own lists. A
geometry_msgs/PoseArray of 5,000 poses takes 0.1 ms instead of 20.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap, GetMapResponse, LoadMap, LoadMapResponse, SetMap, SetMapRequest
from numpy.typing import NDArray
from rospy.numpy_msg import numpy_msg

from rosbot_patrol.ros.messages.convert import time_to_msg

GridMsg = numpy_msg(OccupancyGrid)


class GetMapFast(GetMap):
    """nav_msgs/GetMap with the answer's cells as a numpy array."""

    _response_class = numpy_msg(GetMapResponse)


class LoadMapFast(LoadMap):
    """nav_msgs/LoadMap with the answer's cells as a numpy array."""

    _response_class = numpy_msg(LoadMapResponse)


class SetMapFast(SetMap):
    """nav_msgs/SetMap with the request's cells as a numpy array."""

    _request_class = numpy_msg(SetMapRequest)


class PoseArrayOfRows(PoseArray):
    """A PoseArray for sending only: its poses are rows x, y, z, qx, qy, qz, qw of one array, shape (N, 7)."""

    __slots__ = ("rows",)

    def serialize(self, buff: Any) -> None:
        """Write the message in the format of its type."""
        frame = self.header.frame_id.encode()
        stamp = self.header.stamp
        head = struct.pack("<3II", self.header.seq, stamp.secs, stamp.nsecs, len(frame))
        buff.write(head + frame + struct.pack("<I", len(self.rows)))
        buff.write(np.ascontiguousarray(self.rows, dtype="<f8").tobytes())


def pose_array_to_msg(poses: NDArray[np.float64], frame: str, stamp: float) -> PoseArrayOfRows:
    """Message with planar poses of shape (N, 3), for sending."""
    message = PoseArrayOfRows()
    message.header.frame_id, message.header.stamp = frame, time_to_msg(stamp)
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = np.sin(poses[:, 2] / 2.0), np.cos(poses[:, 2] / 2.0)
    message.rows = rows
    return message
