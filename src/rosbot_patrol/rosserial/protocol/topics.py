"""Frames with topic ids below 100: topic negotiation, time, log and parameter requests.

Serialised as in ROS 1 (little endian, strings with a uint32 length) by struct, so that no message class is needed.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import encode

FIRST_USER_ID = 100


class TopicId(IntEnum):
    """Reserved topic ids (rosserial_msgs/TopicInfo; 8 and 9 are ours, see `proof`)."""

    PUBLISHER = 0
    SUBSCRIBER = 1
    SERVICE_SERVER_PUBLISHER = 2
    SERVICE_SERVER_SUBSCRIBER = 3
    SERVICE_CLIENT_PUBLISHER = 4
    SERVICE_CLIENT_SUBSCRIBER = 5
    PARAMETER_REQUEST = 6
    LOG = 7
    CHALLENGE = 8
    PROOF = 9
    TIME = 10
    TX_STOP = 11


NEGOTIATION_IDS = frozenset(range(6))

ESP_TRIGGER_MD5 = "95f4bf9b776b2424e3a9da1182e3a9d2"
ESP_TRIGGER_TYPES = ("rosbot_patrol/EspTrigger", "rosbot_patrol_simulation/EspTrigger")

REQUEST_TOPICS = encode(TopicId.PUBLISHER)
TX_STOP = encode(TopicId.TX_STOP)


@dataclass(frozen=True, kw_only=True)
class TopicInfo:
    """One topic as a device announces it (rosserial_msgs/TopicInfo).

    Attributes:
        topic_id: the id that its frames carry.
        name: topic or service name; message_type: "package/Type"; md5: sum of its definition.
        buffer_size: the largest message that the device can hold [bytes].
    """

    topic_id: int
    name: str
    message_type: str
    md5: str
    buffer_size: int = 512


def _pack_string(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def take(self, layout: str) -> tuple[int, ...]:
        try:
            values = struct.unpack_from(layout, self._data, self._at)
        except struct.error as err:
            raise ProtocolError("", f"a message of {count_of(len(self._data), 'byte')} ends too early") from err
        self._at += struct.calcsize(layout)
        return values

    def string(self) -> str:
        (length,) = self.take("<I")
        end = self._at + length
        if end > len(self._data):
            raise ProtocolError(
                "", f"a text of {count_of(length, 'byte')} does not fit into its message of {len(self._data)}"
            )
        text = self._data[self._at : end]
        self._at = end
        return text.decode("utf-8", errors="replace")


def pack_topic_info(info: TopicInfo) -> bytes:
    """Serialise a TopicInfo."""
    return b"".join(
        (
            struct.pack("<H", info.topic_id),
            _pack_string(info.name),
            _pack_string(info.message_type),
            _pack_string(info.md5),
            struct.pack("<i", info.buffer_size),
        )
    )


def unpack_topic_info(data: bytes) -> TopicInfo:
    """Read a TopicInfo.

    Raises:
        ProtocolError: the bytes are none.
    """
    reader = _Reader(data)
    (topic_id,) = reader.take("<H")
    name, message_type, md5 = reader.string(), reader.string(), reader.string()
    (buffer_size,) = reader.take("<i")
    return TopicInfo(topic_id=topic_id, name=name, message_type=message_type, md5=md5, buffer_size=buffer_size)


def pack_time(seconds: int, nanoseconds: int) -> bytes:
    """Serialise std_msgs/Time."""
    return struct.pack("<II", seconds & 0xFFFFFFFF, nanoseconds)


def unpack_time(data: bytes) -> float:
    """Read std_msgs/Time [s]; raises ProtocolError."""
    seconds, nanoseconds = _Reader(data).take("<II")
    return seconds + nanoseconds * 1e-9


def pack_log(level: int, text: str) -> bytes:
    """Serialise rosserial_msgs/Log (level 0 debug to 4 fatal)."""
    return struct.pack("<B", level) + _pack_string(text)


def unpack_log(data: bytes) -> tuple[int, str]:
    """Read rosserial_msgs/Log; raises ProtocolError."""
    reader = _Reader(data)
    (level,) = reader.take("<B")
    return level, reader.string()


def pack_esp_trigger(sensor_id: int, move: bool) -> bytes:
    """Serialise rosbot_patrol/EspTrigger."""
    return bytes((sensor_id & 0xFF, 1 if move else 0))


def unpack_esp_trigger(data: bytes) -> tuple[int, bool]:
    """Read rosbot_patrol/EspTrigger: sensor id, and whether there is motion; raises ProtocolError."""
    if len(data) != 2:
        raise ProtocolError("", f"an EspTrigger of {count_of(len(data), 'byte')}, expected 2")
    return data[0], data[1] != 0


@dataclass(frozen=True, kw_only=True)
class ParamValues:
    """Answer to a parameter request (rosserial_msgs/RequestParam): at most one of the lists is filled."""

    ints: tuple[int, ...] = field(default=())
    floats: tuple[float, ...] = field(default=())
    strings: tuple[str, ...] = field(default=())


def param_values(value: object) -> ParamValues:
    """Convert a ROS parameter to the answer's form: bool and int as ints, lists of one type.

    Raises:
        ProtocolError: the value is a group, an empty list, of mixed types, or an integer beyond 32 bits.
    """
    items: list[Any] = list(value) if isinstance(value, (list, tuple)) else [value]
    if all(isinstance(item, int) for item in items):
        if all(-(2**31) <= item < 2**31 for item in items):
            return ParamValues(ints=tuple(int(item) for item in items))
        raise ProtocolError("", f"{value!r} does not fit into 32 bits")
    if all(isinstance(item, float) for item in items):
        return ParamValues(floats=tuple(items))
    if all(isinstance(item, str) for item in items):
        return ParamValues(strings=tuple(items))
    raise ProtocolError("", f"{value!r} is neither a number, a text nor a list of one of these")


def unpack_param_request(data: bytes) -> str:
    """Read the name of the requested parameter; raises ProtocolError."""
    return _Reader(data).string()


def pack_param_values(values: ParamValues) -> bytes:
    """Serialise the response of rosserial_msgs/RequestParam."""
    parts = [struct.pack("<I", len(values.ints)), struct.pack(f"<{len(values.ints)}i", *values.ints)]
    parts += [struct.pack("<I", len(values.floats)), struct.pack(f"<{len(values.floats)}f", *values.floats)]
    parts += [struct.pack("<I", len(values.strings)), *map(_pack_string, values.strings)]
    return b"".join(parts)
