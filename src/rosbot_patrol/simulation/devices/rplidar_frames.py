"""Frames of an RPLIDAR's scan, made from distances: the inverse of `drivers.rplidar.samples`."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.drivers.rplidar import ultra
from rosbot_patrol.drivers.rplidar.frames import capsule_checksum, hq_checksum
from rosbot_patrol.drivers.rplidar.protocol import AnswerType

Floats = NDArray[np.float64]
Distances = Callable[[Floats], Floats]  # of angles [degrees, clockwise]: [mm], 0 for no echo

SAMPLES = {
    AnswerType.NODES: 1,
    AnswerType.EXPRESS: 32,
    AnswerType.HQ: 96,
    AnswerType.ULTRA: 96,
    AnswerType.DENSE: 40,
    AnswerType.ULTRA_DENSE: 64,
}
_STRENGTH = 47  # of every echo, of 63
_QUALITY = 200  # likewise, of 255
_NEXT_SAMPLES = 3  # of the next cabin, which an ultra capsule predicts from


def frame(kind: AnswerType, start: float, step: float, distances: Distances, *, is_new_scan: bool = False) -> bytes:
    """The frame of a scan that begins at an angle.

    Args:
        kind: of the stream.
        start: angle of its first sample [degrees, clockwise], 0 to 360.
        step: between two samples [degrees].
        distances: of angles [degrees].
        is_new_scan: set the start bit of a capsule.
    """
    if kind is AnswerType.NODES:
        return _node(start, step, distances)
    if kind is AnswerType.HQ:
        return _hq(start, step, distances)
    count = SAMPLES[kind]
    coded, next_coded = (int((start + step * each) * 64.0) for each in (0, count))
    start, step = coded / 64.0, (next_coded - coded) / 64.0 / count  # as who reads it will take them
    head = struct.pack("<H", (coded & 0x7FFF) | (0x8000 if is_new_scan else 0))
    body = {
        AnswerType.EXPRESS: _express,
        AnswerType.ULTRA: _ultra,
        AnswerType.DENSE: _dense,
        AnswerType.ULTRA_DENSE: _ultra_dense,
    }[kind](start, step, distances)
    if kind is AnswerType.ULTRA_DENSE:
        head = bytes(6) + head  # time and status
    total = capsule_checksum(bytes(2) + head + body)
    return bytes((0xA0 | total & 15, 0x50 | total >> 4)) + head + body


def _angles(start: float, step: float, count: int) -> Floats:
    return start + step * np.arange(count)


def _whole(distances: Distances, angles: Floats, largest: int) -> NDArray[np.int64]:
    found = distances(angles % 360.0)
    return np.where(found <= largest, found, 0.0).astype(np.int64)


def _node(start: float, step: float, distances: Distances) -> bytes:
    distance = int(_whole(distances, np.array([start]), 16383)[0])
    first = start % 360.0 < step
    quality = _STRENGTH << 2 if distance else 0
    return struct.pack("<BHH", quality | (1 if first else 2), int(start * 64.0) << 1 | 1, distance << 2)


def _hq(start: float, step: float, distances: Distances) -> bytes:
    angles = _angles(start, step, 96) % 360.0
    distance = _whole(distances, angles, 1 << 29)
    body = b"\xa5" + bytes(8)
    for angle, far in zip(angles.tolist(), distance.tolist(), strict=True):
        body += struct.pack("<HIBB", int(angle * 65536 / 360), far << 2, _QUALITY if far else 0, int(angle < step))
    return body + hq_checksum(body + bytes(4)).to_bytes(4, "little")


def _express(start: float, step: float, distances: Distances) -> bytes:
    distance = _whole(distances, _angles(start, step, 32), 16383) << 2
    return b"".join(struct.pack("<HHB", *pair, 0) for pair in distance.reshape(16, 2).tolist())


def _dense(start: float, step: float, distances: Distances) -> bytes:
    return _whole(distances, _angles(start, step, 40), 65535).astype("<u2").tobytes()


def _ultra(start: float, step: float, distances: Distances) -> bytes:
    angles = _angles(start, step, 96 + _NEXT_SAMPLES)
    distance = _whole(distances, angles - 8.0, 16384 + 767 * 16)
    for _ in range(4):  # each sample's angle depends on its distance
        offset = ultra.angle_offsets(distance << 2) / 65536.0
        distance = _whole(distances, angles - offset, 16384 + 767 * 16)
    triples = distance.reshape(-1, 3)
    code, shift = ultra.encode(triples[:, 0])
    base, _ = ultra.decode(code)
    words = code[:-1].copy()
    is_alone = base[:-1] == 0
    bases = np.where(is_alone, base[1:], base[:-1]), base[1:]
    shifts = np.where(is_alone, shift[1:], shift[:-1]), shift[1:]
    for column, at in ((1, 12), (2, 22)):
        predicted = np.clip((triples[:-1, column] - bases[column - 1]) >> shifts[column - 1], -511, 510)
        predicted = np.where(triples[:-1, column] == 0, -512, predicted)
        words |= (predicted & 0x3FF) << at
    return words.astype("<u4").tobytes()


def _ultra_dense(start: float, step: float, distances: Distances) -> bytes:
    distance = _whole(distances, _angles(start, step, 64), 65000)
    body = b""
    for first, second in distance.reshape(32, 2).tolist():
        a, b = _scaled(first), _scaled(second)
        body += struct.pack("<HHB", a & 0xFFFF, b & 0xFFFF, a >> 16 | (b >> 16) << 4)
    return body


def _scaled(distance: int) -> int:
    quality = _QUALITY if distance else 0
    for scale, (low, high, factor) in enumerate(((0, 2046, 2), (2046, 8187, 3), (8187, 24567, 4))):
        if distance <= high:
            return scale | ((distance - low) * 4 // factor) & ((0x1000 << scale) - 4) | (quality >> scale) << 12 + scale
    return 3 | ((distance - 24567) * 4 // 5) & 0x7FFC | (quality >> 3) << 15
