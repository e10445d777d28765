"""Framing of rosserial (protocol version 0xfe, since hydro).

    ff fe | length, int16 LE | 255 - sum(length bytes) % 256 | topic id, uint16 LE | data | 255 - sum(id, data) % 256

The parser takes bytes in pieces of any size and returns whole frames. Invalid bytes are counted and skipped: it looks
for the next sync bytes right after the failed ones, so a truncated frame costs only itself.

Differs: rosserial_python reads the length in a damaged header and loses the good frames after it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ProtocolError

SYNC = b"\xff\xfe"
HEADER = 7  # up to and with the topic id
OVERHEAD = HEADER + 1
MAX_PAYLOAD = 0x7FFF


class Packet(NamedTuple):
    """One frame: topic id and serialised message."""

    topic_id: int
    data: bytes


def checksum(data: bytes | bytearray | memoryview) -> int:
    """The byte that makes the sum of `data` and itself 255 modulo 256."""
    return 255 - sum(data) % 256


def encode(topic_id: int, data: bytes = b"") -> bytes:
    """Make the bytes of one frame.

    Raises:
        ProtocolError: the data are too long for the format.
    """
    if len(data) > MAX_PAYLOAD:
        raise ProtocolError("", f"{len(data)} bytes for topic id {topic_id}, a frame holds {MAX_PAYLOAD}")
    length = struct.pack("<H", len(data))
    body = struct.pack("<H", topic_id) + data
    return b"".join((SYNC, length, bytes((checksum(length),)), body, bytes((checksum(body),))))


class Parser:
    """Converts a stream of bytes to frames; never raises, and holds at most one frame of `max_payload` bytes.

    Attributes:
        frames: good frames so far.
        garbage: bytes skipped so far that belonged to no frame.
        bad_checksums: frames with a wrong checksum.
        oversized: headers that announced more than `max_payload` bytes.
        garbage_run: bytes skipped since the last good frame.
        fault: description of the first frame with a wrong checksum or length, "" before the first.
    """

    def __init__(self, max_payload: int = MAX_PAYLOAD) -> None:
        self.max_payload = min(max_payload, MAX_PAYLOAD)
        self.frames = 0
        self.garbage = 0
        self.bad_checksums = 0
        self.oversized = 0
        self.garbage_run = 0
        self.fault = ""
        self._buffer = bytearray()

    @property
    def pending(self) -> int:
        """Number of bytes of an incomplete frame."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Packet]:
        """Add received bytes; returns the frames that they complete."""
        stream: bytes | bytearray = data
        if self._buffer:
            self._buffer += data
            stream = self._buffer
        packets: list[Packet] = []
        start = self._scan(stream, packets)
        if stream is self._buffer:
            del self._buffer[:start]
        elif start < len(stream):
            self._buffer += stream[start:]
        return packets

    def give_up(self) -> list[Packet]:
        """Give up the incomplete frame; returns whole frames found after its first byte."""
        if not self._buffer:
            return []
        self._skip(1)
        del self._buffer[:1]
        return self.feed(b"")

    def _scan(self, stream: bytes | bytearray, packets: list[Packet]) -> int:
        """Append the frames in `stream`; returns the index of the first undecided byte."""
        start, length = 0, len(stream)
        while True:
            found = stream.find(SYNC, start)
            if found < 0:
                end = length - (1 if length > start and stream[-1] == 0xFF else 0)
                self._skip(end - start)
                return end
            if found > start:
                self._skip(found - start)
                start = found
            if length - start < 5:
                return start
            low, high = stream[start + 2], stream[start + 3]
            if (low + high + stream[start + 4]) & 0xFF != 0xFF:
                start = self._resync(start)
                continue
            size = low | high << 8
            if size > self.max_payload:
                self.oversized += 1
                self.fault = self.fault or f"a frame of {size} bytes, at most {self.max_payload} are taken"
                start = self._resync(start)
                continue
            end = start + OVERHEAD + size
            if length < end:
                return start
            if sum(stream[start + 5 : end]) & 0xFF != 0xFF:
                self.bad_checksums += 1
                self.fault = self.fault or self._bad_sum(stream[start + 5 : end])
                start = self._resync(start)
                continue
            self.frames += 1
            self.garbage_run = 0
            topic_id = stream[start + 5] | stream[start + 6] << 8
            packets.append(Packet(topic_id, bytes(stream[start + HEADER : end - 1])))
            start = end

    @staticmethod
    def _bad_sum(body: bytes | bytearray) -> str:
        topic_id = body[0] | body[1] << 8
        right = checksum(body[:-1])
        size = count_of(len(body) - 3, "byte")
        return f"{size} for topic id {topic_id} with checksum {body[-1]:02x}, it would be {right:02x}"

    def _resync(self, start: int) -> int:
        self._skip(1)
        return start + 1

    def _skip(self, count: int) -> None:
        self.garbage += count
        self.garbage_run += count
