"""Proof of a sensor's identity with a pre-shared key, before anything else on its connection.

    bridge -> device  topic id 8   01 | server nonce (32)
    device -> bridge  topic id 9   01 | sensor id (1) | device nonce (16) | HMAC(key, SENSOR + both nonces + id) (32)
    bridge -> device  topic id 9   01 | HMAC(key, BRIDGE + both nonces + id) (32)

HMAC is that of RFC 2104 with SHA-256. The nonces are random and new on each connection, so that a recorded proof is
worthless on another one. The labels differ by direction, so that a proof cannot be reflected. Upstream rosserial uses
neither topic id.

A device that answers with version 02 in place of 01 (and labels that end in v2) signs every later frame, as the bridge
does (`signed`). Version 01, of older firmware, authenticates the connection alone. The labels differ by version, so
nobody in between can turn one into the other.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Mapping

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.signed import session_key
from rosbot_patrol.rosserial.protocol.topics import TopicId

VERSION = b"\x01"  # of challenges, and of proofs without signed frames
SIGNED = b"\x02"
KEY_SIZE = 32
SERVER_NONCE_SIZE = 32
DEVICE_NONCE_SIZE = 16
MAC_SIZE = 32
PROOF_TIMEOUT = 5.0  # for the device to answer [s]
MAX_PAYLOAD = 64  # of a frame before the proof [bytes]
MAX_BYTES = 4096  # of all that a device may send before its proof

_SENSOR = {VERSION: b"rosbot_patrol sensor v1", SIGNED: b"rosbot_patrol sensor v2"}
_BRIDGE = {VERSION: b"rosbot_patrol bridge v1", SIGNED: b"rosbot_patrol bridge v2"}
_PROOF_SIZE = 1 + 1 + DEVICE_NONCE_SIZE + MAC_SIZE


def sensor_mac(key: bytes, server_nonce: bytes, device_nonce: bytes, sensor_id: int, version: bytes = VERSION) -> bytes:
    """MAC that proves that a device has the key of that sensor."""
    return hmac.digest(key, _SENSOR[version] + server_nonce + device_nonce + bytes((sensor_id,)), hashlib.sha256)


def bridge_mac(key: bytes, server_nonce: bytes, device_nonce: bytes, sensor_id: int, version: bytes = VERSION) -> bytes:
    """MAC that proves to the device that this is its bridge."""
    return hmac.digest(key, _BRIDGE[version] + device_nonce + server_nonce + bytes((sensor_id,)), hashlib.sha256)


class Gate:
    """The bridge's side of one unproven connection.

    Args:
        keys: by sensor id.
        nonce: 32 random bytes; only tests give them.

    Attributes:
        challenge: the frame to send first.
        session: key of the signed frames that follow the proof; None: they are not signed.
    """

    def __init__(self, keys: Mapping[int, bytes], nonce: bytes | None = None) -> None:
        self._keys = keys
        self._nonce = secrets.token_bytes(SERVER_NONCE_SIZE) if nonce is None else nonce
        self.challenge = encode(TopicId.CHALLENGE, VERSION + self._nonce)
        self.session: bytes | None = None

    def check(self, data: bytes) -> tuple[int, bytes]:
        """Check a proof; returns the sensor id and the answering frame.

        Raises:
            ProtocolError: the proof is invalid.
        """
        version = data[:1]
        if len(data) != _PROOF_SIZE or version not in _SENSOR:
            raise ProtocolError(
                "", f"{count_of(len(data), 'byte that is', 'bytes that are')} no proof of version 1 or 2"
            )
        sensor_id, device_nonce, mac = data[1], data[2 : 2 + DEVICE_NONCE_SIZE], data[2 + DEVICE_NONCE_SIZE :]
        key = self._keys.get(sensor_id)
        # without a key the MAC is computed all the same, so that the time taken does not reveal which ids exist
        expected = sensor_mac(key or bytes(KEY_SIZE), self._nonce, device_nonce, sensor_id, version)
        is_good = hmac.compare_digest(mac, expected)
        if key is None:
            raise ProtocolError("", f"a proof for sensor {sensor_id}, which has no key here")
        if not is_good:
            raise ProtocolError("", f"a wrong proof for sensor {sensor_id} (another key, or an old proof sent again)")
        answer = version + bridge_mac(key, self._nonce, device_nonce, sensor_id, version)
        if version == SIGNED:
            self.session = session_key(key, self._nonce, device_nonce, sensor_id)
        return sensor_id, encode(TopicId.PROOF, answer)


class Prover:
    """The device's side of one connection: answers the challenge and checks the bridge's answer.

    Args:
        sensor_id: 0 to 255; key: its 32 bytes.
        version: of the proof; with VERSION, as older firmware has it, frames are not signed.

    Attributes:
        session: key of the signed frames that follow the proof; None: they are not signed.
    """

    def __init__(self, sensor_id: int, key: bytes, version: bytes = SIGNED) -> None:
        if len(key) != KEY_SIZE:
            raise ValueError(f"a key has {KEY_SIZE} bytes, not {len(key)}")
        self._sensor_id = sensor_id
        self._key, self._version = key, version
        self._expected: bytes | None = None
        self.session: bytes | None = None

    def answer(self, challenge: bytes, nonce: bytes | None = None) -> bytes:
        """Frame that answers a challenge (`nonce`: for tests only).

        Raises:
            ProtocolError: it is no challenge.
        """
        if len(challenge) != 1 + SERVER_NONCE_SIZE or challenge[:1] != VERSION:
            raise ProtocolError(
                "", f"{count_of(len(challenge), 'byte that is', 'bytes that are')} no challenge of version 1"
            )
        server_nonce = challenge[1:]
        nonce = secrets.token_bytes(DEVICE_NONCE_SIZE) if nonce is None else nonce
        version = self._version
        self._expected = version + bridge_mac(self._key, server_nonce, nonce, self._sensor_id, version)
        if version == SIGNED:
            self.session = session_key(self._key, server_nonce, nonce, self._sensor_id)
        mac = sensor_mac(self._key, server_nonce, nonce, self._sensor_id, version)
        return encode(TopicId.PROOF, version + bytes((self._sensor_id,)) + nonce + mac)

    def confirms(self, answer: bytes) -> bool:
        """Whether the bridge's answer to the last proof shows that it has the key, too."""
        return self._expected is not None and hmac.compare_digest(answer, self._expected)
