"""Conversion between pictures and sensor_msgs/Image."""

from __future__ import annotations

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from rosbot_patrol.images.encodings import Picture, pack, unpack


def picture_from_msg(msg: Image) -> Picture:
    """Convert a message to a picture; ImageError if its encoding or sizes are invalid."""
    return unpack(
        msg.data,
        msg.encoding,
        width=msg.width,
        height=msg.height,
        step=msg.step,
        big_endian=bool(msg.is_bigendian),
    )


def picture_to_msg(picture: Picture, header: Header) -> Image:
    """Message of a picture, with this header."""
    data, step = pack(picture)
    return Image(
        header=header,
        height=picture.height,
        width=picture.width,
        encoding=picture.encoding,
        is_bigendian=0,
        step=step,
        data=data,
    )
