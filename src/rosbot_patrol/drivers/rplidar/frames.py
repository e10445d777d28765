"""Frames in the stream of a scan, found again after lost or wrong bytes.

Standard nodes have 5 bytes with two check bits. Capsules begin with the nibbles A and 5, beside the two halves of the
XOR of all later bytes. Frames of the HQ mode begin with A5 and end with a CRC-32.
"""

from __future__ import annotations

import zlib

import numpy as np

from rosbot_patrol.drivers.rplidar.protocol import AnswerType

NODE_SIZE = 5
FRAME_SIZES = {
    AnswerType.NODES: NODE_SIZE,
    AnswerType.EXPRESS: 84,
    AnswerType.HQ: 781,
    AnswerType.ULTRA: 132,
    AnswerType.DENSE: 84,
    AnswerType.ULTRA_DENSE: 170,
}
_HQ_SYNC = 0xA5
_CRC = 4  # [bytes] at the end of an HQ frame


def capsule_checksum(frame: bytes) -> int:
    """XOR of all bytes of a capsule behind its two first."""
    return int(np.bitwise_xor.reduce(np.frombuffer(frame, np.uint8, offset=2)))


def hq_checksum(frame: bytes) -> int:
    """CRC-32 of an HQ frame without its last four bytes, filled up with zeros to a multiple of four."""
    body = frame[:-_CRC]
    return zlib.crc32(body + bytes(-len(body) % 4))


class FrameFinder:
    """Cut a stream into frames.

    Args:
        kind: type of the stream's answer.

    Attributes:
        skipped: bytes that belonged to no frame.
        spoilt: frames with a wrong checksum.
    """

    def __init__(self, kind: AnswerType) -> None:
        self._kind = kind
        self._size = FRAME_SIZES[kind]
        self._data = bytearray()
        self.skipped = 0
        self.spoilt = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes, cut anywhere; returns whole frames, and b"" in place of each spoilt one.

        Standard nodes come as one block of several frames.
        """
        self._data += data
        if self._kind is AnswerType.NODES:
            block = self._nodes()
            return [block] if block else []
        found = []
        while (frame := self._next()) is not None:
            found.append(frame)
        return found

    def _next(self) -> bytes | None:
        while len(self._data) >= 2:
            if not self._begins():
                self._skip(1)
                continue
            if len(self._data) < self._size:
                return None
            frame = bytes(self._data[: self._size])
            if self._is_whole(frame):
                del self._data[: self._size]
                return frame
            self.spoilt += 1
            self._skip(1)
            return b""
        return None

    def _begins(self) -> bool:
        if self._kind is AnswerType.HQ:
            return self._data[0] == _HQ_SYNC
        return self._data[0] >> 4 == 0xA and self._data[1] >> 4 == 0x5

    def _is_whole(self, frame: bytes) -> bool:
        if self._kind is AnswerType.HQ:
            return hq_checksum(frame) == int.from_bytes(frame[-_CRC:], "little")
        return capsule_checksum(frame) == (frame[0] & 15) | (frame[1] & 15) << 4

    def _nodes(self) -> bytes:
        """All whole nodes at the head, past bytes that begin none."""
        block = bytearray()
        while len(self._data) >= NODE_SIZE:
            count = _count_nodes(bytes(self._data))
            block += self._data[: count * NODE_SIZE]
            del self._data[: count * NODE_SIZE]
            if len(self._data) >= NODE_SIZE:
                self._skip(1)
        return bytes(block)

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._data[:count]


def _count_nodes(data: bytes) -> int:
    """Number of nodes at the start of the data, up to the first with wrong check bits."""
    count = len(data) // NODE_SIZE
    nodes = np.frombuffer(data, np.uint8, count * NODE_SIZE).reshape(count, NODE_SIZE)
    is_right = (((nodes[:, 0] ^ nodes[:, 0] >> 1) & nodes[:, 1] & 1) == 1).tolist()
    return is_right.index(False) if False in is_right else count
