"""Pictures of a bag, raw or compressed, in the detector's form."""

from __future__ import annotations

import importlib
from typing import Any, NamedTuple

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import Picture, unpack
from rosbot_patrol.replay.bags.definitions import STAMP
from rosbot_patrol.replay.bags.records import Kind, Refused, stamp_of


class PictureRecord(NamedTuple):
    """sensor_msgs/Image or CompressedImage: its time [s], and the picture."""

    stamp: float
    picture: Picture


def _raw(message: Any) -> PictureRecord | Refused:
    size = {"width": int(message.width), "height": int(message.height), "step": int(message.step)}
    try:
        picture = unpack(message.data, message.encoding, **size, big_endian=bool(message.is_bigendian))
    except ImageError as err:
        return Refused(str(err))
    return PictureRecord(stamp_of(message.header.stamp), picture)


def _compressed(message: Any) -> PictureRecord | Refused:
    codec = importlib.import_module("rosbot_patrol.images.compressed")  # loads simplejpeg: only for compressed pictures
    try:
        picture = codec.decompress(message.format, bytes(message.data))
    except ImageError as err:
        return Refused(str(err))
    return PictureRecord(stamp_of(message.header.stamp), picture)


KINDS: dict[str, Kind] = {
    "sensor_msgs/msg/Image": Kind(
        _raw,
        STAMP
        | {"height": "int", "width": "int", "step": "int", "is_bigendian": "int"}
        | {"encoding": "string", "data": "int[]"},
    ),
    "sensor_msgs/msg/CompressedImage": Kind(_compressed, STAMP | {"format": "string", "data": "int[]"}),
}
