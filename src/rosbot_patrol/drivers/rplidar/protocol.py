"""Wire format of an RPLIDAR: requests, and the answers in a stream of bytes.

A request is `A5 command`. From command 0x80 on it also has a length, a payload and the XOR of all bytes before it. An
answer begins with a descriptor: `A5 5A`, size and sub-type in four bytes, type. Numbers are little endian. After the
descriptor of a stream, frames follow until the command STOP, without further descriptors.

Source: the public headers `sl_lidar_cmd.h` and `sl_lidar_protocol.h` of Slamtec's SDK 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from operator import xor

from rosbot_patrol.errors import ProtocolError

SYNC = 0xA5
_ANSWER = b"\xa5\x5a"
_DESCRIPTOR = 7  # [bytes]
_SIZE = 0x3FFFFFFF
_STREAM = 0x40000000
_LARGEST = 1024  # [bytes] no answer is larger: what says so is noise


class Command(IntEnum):
    """Commands to the lidar."""

    SCAN = 0x20
    STOP = 0x25
    RESET = 0x40
    GET_INFO = 0x50
    GET_HEALTH = 0x52
    GET_SAMPLE_TIMES = 0x59
    EXPRESS_SCAN = 0x82
    GET_CONF = 0x84
    SET_MOTOR_RPM = 0xA8
    SET_MOTOR_PWM = 0xF0
    GET_MOTOR_FLAGS = 0xFF


class AnswerType(IntEnum):
    """Types of answers; those from NODES to ULTRA_DENSE are streams of samples."""

    INFO = 0x04
    HEALTH = 0x06
    SAMPLE_TIMES = 0x15
    CONF = 0x20
    NODES = 0x81
    EXPRESS = 0x82
    HQ = 0x83
    ULTRA = 0x84
    DENSE = 0x85
    ULTRA_DENSE = 0x86
    MOTOR_FLAGS = 0xFF


@dataclass(frozen=True)
class Answer:
    """One answer, or the next bytes of a stream.

    Attributes:
        type: an `AnswerType`, or a number that this driver does not know.
        payload: of the answer; of a stream, the bytes that have arrived, cut anywhere.
    """

    type: int
    payload: bytes
    is_stream: bool = False


def checksum(data: bytes) -> int:
    """XOR of all bytes."""
    return reduce(xor, data, 0)


def request(command: int, payload: bytes = b"") -> bytes:
    """The bytes of a request.

    Raises:
        ProtocolError: a command below 0x80 has no payload, and a payload has at most 255 bytes.
    """
    if command < 0x80:
        if payload:
            raise ProtocolError("", f"the command 0x{command:02X} takes no payload")
        return bytes((SYNC, command))
    if len(payload) > 0xFF:
        raise ProtocolError("", f"a payload has at most 255 bytes, not {len(payload)}")
    body = bytes((SYNC, command, len(payload))) + payload
    return body + bytes((checksum(body),))


def descriptor(answer: int, size: int, *, is_stream: bool = False) -> bytes:
    """The descriptor before an answer, as a device sends it."""
    return _ANSWER + (size | (_STREAM if is_stream else 0)).to_bytes(4, "little") + bytes((answer,))


class AnswerReader:
    """Finds answers in a stream of bytes, and skips all other bytes.

    Attributes:
        skipped: bytes that belonged to no answer, since the last reset.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what has arrived: before each request, since an old stream may still be in the pipe."""
        self._data = bytearray()
        self._stream: int | None = None
        self.skipped = 0

    def feed(self, data: bytes) -> list[Answer]:
        """Take bytes, cut anywhere; returns the answers that they complete."""
        if self._stream is not None:
            return [Answer(self._stream, data, is_stream=True)] if data else []
        self._data += data
        found = []
        while (answer := self._next()) is not None:
            found.append(answer)
            if answer.is_stream:
                break
        return found

    def _next(self) -> Answer | None:
        while (start := self._data.find(_ANSWER)) >= 0:
            self._skip(start)
            if len(self._data) < _DESCRIPTOR:
                return None
            coded = int.from_bytes(self._data[2:6], "little")
            size, end = coded & _SIZE, _DESCRIPTOR + (coded & _SIZE)
            if size > _LARGEST:
                self._skip(1)
                continue
            if coded & _STREAM:
                return self._begin_stream()
            if len(self._data) < end:
                return None
            answer = Answer(self._data[6], bytes(self._data[_DESCRIPTOR:end]))
            del self._data[:end]
            return answer
        self._skip(len(self._data) - (self._data[-1:] == _ANSWER[:1]))
        return None

    def _begin_stream(self) -> Answer:
        self._stream = self._data[6]
        answer = Answer(self._stream, bytes(self._data[_DESCRIPTOR:]), is_stream=True)
        self._data.clear()
        return answer

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._data[:count]
