"""Frames that are signed, after a proof of version 2: nobody between sensor and bridge can add, change or drop one.

    payload of a frame = its data | counter, uint32 LE | tag
    tag = first 8 bytes of HMAC(direction's key, topic id + counter + data)
    session key = HMAC(sensor's key, SESSION + both nonces + id)
    direction's key = HMAC(session key, "from the sensor" or "from the bridge")

HMAC is HMAC-SHA256 (RFC 2104). The counter begins at 0 for each direction and goes up by one with each frame, so
a frame that is repeated, missing or out of order is noticed at the next one. A connection with such a frame ends: the
sensor comes back with new nonces. The proof's own frames are not signed, because they are signatures themselves.

The data are not encrypted: who reads the packets sees when somebody moves.
"""

from __future__ import annotations

import hashlib
import hmac
import struct

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import HEADER, encode
from rosbot_patrol.rosserial.protocol.topics import TopicId

TAG_SIZE = 8
OVERHEAD = 4 + TAG_SIZE  # bytes more in each payload
FROM_SENSOR, FROM_BRIDGE = b"from the sensor", b"from the bridge"
UNSIGNED = frozenset({TopicId.CHALLENGE, TopicId.PROOF})
_SESSION = b"rosbot_patrol session v2"


def session_key(key: bytes, server_nonce: bytes, device_nonce: bytes, sensor_id: int) -> bytes:
    """Key of one connection."""
    return hmac.digest(key, _SESSION + server_nonce + device_nonce + bytes((sensor_id,)), hashlib.sha256)


class _Direction:
    def __init__(self, session: bytes, direction: bytes) -> None:
        self._key = hmac.digest(session, direction, hashlib.sha256)
        self._count = 0

    def _tag(self, topic_id: int, data: bytes) -> bytes:
        signed = struct.pack("<HI", topic_id, self._count) + data
        return hmac.digest(self._key, signed, hashlib.sha256)[:TAG_SIZE]


class Signer(_Direction):
    """The sending side of a direction: signs frames in the order in which they leave."""

    def sign(self, frame: bytes) -> bytes:
        """Sign one whole frame of `packet.encode`; a frame of the proof stays as it is."""
        topic_id = frame[HEADER - 2] | frame[HEADER - 1] << 8
        if topic_id in UNSIGNED:
            return frame
        data = frame[HEADER:-1]
        payload = data + struct.pack("<I", self._count) + self._tag(topic_id, data)
        self._count += 1
        return encode(topic_id, payload)


class Checker(_Direction):
    """The receiving side of a direction."""

    def check(self, topic_id: int, payload: bytes) -> bytes:
        """Check one payload; returns its data.

        Raises:
            ProtocolError: it is not signed, or not the next one.
        """
        data, count, tag = payload[:-OVERHEAD], payload[-OVERHEAD:-TAG_SIZE], payload[-TAG_SIZE:]
        is_next = count == struct.pack("<I", self._count)
        if len(payload) < OVERHEAD or not is_next or not hmac.compare_digest(tag, self._tag(topic_id, data)):
            raise ProtocolError("", f"frame {self._count} is not the one that was sent: {_why(count, self._count)}")
        self._count += 1
        return data


def _why(count: bytes, expected: int) -> str:
    number = int.from_bytes(count, "little") if len(count) == 4 else expected
    if number < expected:
        return f"number {number} came again, or a forged one"
    return f"number {number} came instead, or a forged one" if number > expected else "its signature is wrong"
