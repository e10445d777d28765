"""Turns of an LDS-01: 60 packets of 6 degrees each, 2520 bytes in all.

A packet is FA, A0 + its number, the speed (u16, a tenth of a turn a minute), 6 samples of intensity (u16), distance
(u16, mm) and 2 bytes that are not used, and 2 bytes more. Source: hls_lfcd_lds_driver (noetic).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

START, STOP = b"b", b"e"  # what starts and stops the motor
BAUD = 230400
RANGE_MIN, RANGE_MAX = 0.12, 3.5  # [m]
_PACKETS, _SAMPLES, _SIZE = 60, 6, 42
_TURN = _PACKETS * _SIZE
_SYNC = 0xFA


@dataclass(frozen=True)
class LdsTurn:
    """One turn.

    Attributes:
        ranges: by angle, counter-clockwise from 0 in steps of a degree [m], shape (360,); inf without an echo, NaN for
            a packet that was spoilt.
        intensities: likewise.
        speed: turns a second.
    """

    ranges: NDArray[np.float64]
    intensities: NDArray[np.float64]
    speed: float


class TurnReader:
    """Find turns in a stream of bytes.

    Attributes:
        skipped: bytes that belonged to no turn.
    """

    def __init__(self) -> None:
        self._data = bytearray()
        self.skipped = 0

    def feed(self, data: bytes) -> list[LdsTurn]:
        """The turns that these bytes complete."""
        self._data += data
        turns: list[LdsTurn] = []
        while True:
            start = self._data.find(bytes((_SYNC, 0xA0)))
            if start < 0:
                self._skip(max(len(self._data) - 1, 0))
                return turns
            self._skip(start)
            if len(self._data) < _TURN:
                return turns
            if not self._is_turn():
                self._skip(1)
                continue
            turns.append(_decode(bytes(self._data[:_TURN])))
            del self._data[:_TURN]

    def _is_turn(self) -> bool:
        """Whether most packets begin where they should: two bytes may be equal to a beginning by chance."""
        found = sum(
            self._data[at] == _SYNC and self._data[at + 1] == 0xA0 + number
            for number, at in enumerate(range(0, _TURN, _SIZE))
        )
        return found > _PACKETS // 2

    def _skip(self, count: int) -> None:
        self.skipped += count
        del self._data[:count]


def _decode(data: bytes) -> LdsTurn:
    ranges, intensities = np.full(360, np.nan), np.zeros(360)
    speeds = []
    for number in range(_PACKETS):
        packet = data[number * _SIZE : (number + 1) * _SIZE]
        if packet[0] != _SYNC or packet[1] != 0xA0 + number:
            continue
        speeds.append(struct.unpack_from("<H", packet, 2)[0])
        for sample in range(_SAMPLES):
            intensity, distance = struct.unpack_from("<HH", packet, 4 + 6 * sample)
            at = 359 - (_SAMPLES * number + sample)  # it turns clockwise
            ranges[at] = distance / 1e3 if distance else np.inf
            intensities[at] = intensity
    return LdsTurn(ranges, intensities, float(np.median(speeds)) / 10.0 / 60.0)


def encode(ranges: NDArray[np.float64], speed: float = 5.0) -> bytes:
    """The bytes of a turn, as a lidar would send them: the inverse of `TurnReader`.

    Args:
        ranges: by angle, shape (360,) [m], inf without an echo.
        speed: turns a second.
    """
    out = b""
    for number in range(_PACKETS):
        packet = struct.pack("<BBH", _SYNC, 0xA0 + number, round(speed * 600.0))
        for sample in range(_SAMPLES):
            length = float(ranges[359 - (_SAMPLES * number + sample)])
            hit = np.isfinite(length)
            packet += struct.pack("<HHH", 200 if hit else 0, round(1e3 * length) if hit else 0, 0)
        out += packet + bytes(2)
    return out
