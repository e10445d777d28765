"""What arrives at the patrol, as plain records: ros/ makes them of messages, replay/ of a bag."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rosbot_patrol.patrol.intruder.measure import Lens
from rosbot_patrol.patrol.records.inputs import Box
from rosbot_patrol.patrol.records.request import Origin, Request


class Moment(NamedTuple):
    """One moment on the three clocks of a node; a replay has the bag's clock for all of them.

    Attributes:
        now: ROS time [s], which may be simulated.
        steady: of a clock that nobody sets [s], for time-outs.
        wall: seconds since 1970, for records.
    """

    now: float
    steady: float
    wall: float


class TriggerRecord(NamedTuple):
    """EspTrigger: id of the motion sensor, and whether it sees motion (else it only lives)."""

    sensor: int
    moves: bool


class BoxesRecord(NamedTuple):
    """darknet_ros_msgs/BoundingBoxes: time of the picture [s], 0 if unknown, and the objects in it."""

    stamp: float
    boxes: tuple[Box, ...]


class CountRecord(NamedTuple):
    """darknet_ros_msgs/ObjectCount: time of the picture [s], and the number of objects in it."""

    stamp: float
    objects: int


class LensRecord(NamedTuple):
    """sensor_msgs/CameraInfo: the camera's optical frame and its lens."""

    frame: str
    lens: Lens


class ImageRecord(NamedTuple):
    """sensor_msgs/Image as it came; its pixels are unpacked only if somebody looks at them.

    Attributes:
        stamp: time of the picture [s].
        height, width: size [px]; step: bytes of a row.
        data: all rows.
    """

    stamp: float
    height: int
    width: int
    encoding: str
    is_big_endian: bool
    step: int
    data: bytes | memoryview


class LookRecord(NamedTuple):
    """rosbot_patrol/SensorEvent: the room to look at, -1 for none, and the reason."""

    room: int
    text: str

    def request(self, wall: float) -> Request | None:
        """Make the request to look there, at a time in seconds since 1970; None if no room is asked for."""
        if self.room < 0:
            return None
        return Request(room_id=self.room, origin=Origin.SILENT_SENSOR, note=self.text, wall=wall)


def lens_record(frame: str, k: Sequence[float], *, width: int, height: int) -> LensRecord:
    """Read a camera_info.

    Args:
        frame: of its header.
        k: camera matrix in rows, shape (9,) [px].
        width: of the picture [px].
        height: likewise.

    Raises:
        ValueError: it describes no lens; the text is a sentence.
    """
    if width <= 0 or height <= 0 or k[0] <= 0.0 or k[4] <= 0.0:
        raise ValueError(f"a camera_info of width {width} and focal length {k[0]:g} tells no lens")
    fx, fy, cx, cy = (float(k[i]) for i in (0, 4, 2, 5))
    return LensRecord(frame.lstrip("/"), Lens(fx=fx, fy=fy, cx=cx, cy=cy, width=int(width), height=int(height)))
