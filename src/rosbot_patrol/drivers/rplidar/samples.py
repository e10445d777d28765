"""Samples of the laser, decoded from frames.

Angles run clockwise from the front of the device, in units of the HQ nodes: 16384 is 90 degrees. Distances are in
quarters of a millimetre; 0 means no echo. All arithmetic is the maker's, in whole numbers, so that a frame gives the
very same samples as with the maker's SDK.

A capsule is decoded when the next one has arrived, because the angle of its end is the start of the next. So a spoilt
capsule costs two. A capsule with the start bit begins a new scan: the capsule before it, and the turn under way, are
void.

Source: behaviour of `sdk/src/dataunpacker/unpacker/handler_*.cpp` of Slamtec's SDK 2.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.drivers.rplidar import ultra
from rosbot_patrol.drivers.rplidar.frames import NODE_SIZE
from rosbot_patrol.drivers.rplidar.protocol import AnswerType

Ints = NDArray[np.int64]

TURN_Q14 = 4 << 14  # a full turn in the units of `Samples.angle`
_TURN_Q6, _TURN_Q8, _TURN_Q16 = 360 << 6, 360 << 8, 360 << 16
_HIT = 0x2F << 2  # quality of an echo in modes that do not tell it
_START_AT = {AnswerType.ULTRA_DENSE: 8}  # offset of the start angle in a capsule; 2 in the others
_HEAD = {AnswerType.ULTRA_DENSE: 10}  # size of a capsule's head; 4 in the others
_CABIN = np.dtype([("first", "<u2"), ("second", "<u2"), ("low", "u1")])
_NODE_HQ = np.dtype([("angle", "<u2"), ("distance", "<u4"), ("quality", "u1"), ("flag", "u1")])
_FASTEST = 100.0  # [turns/s] a dense capsule that spans more is void


@dataclass(frozen=True)
class Samples:
    """Samples in the order in which the laser took them; all arrays have the shape (N,).

    Attributes:
        angle: 65536 for a turn, clockwise.
        distance: quarters of a millimetre, 0 for no echo.
        quality: strength of the echo, 0 to 255.
        is_first: whether a turn begins with the sample.
        is_new_scan: whether the turn under way is void.
    """

    angle: Ints
    distance: Ints
    quality: Ints
    is_first: NDArray[np.bool_]
    is_new_scan: bool = False


class Decoder:
    """Frames of one kind of stream to samples.

    Args:
        kind: type of the stream's answer.
        sample_time: between two samples [s].
    """

    def __init__(self, kind: AnswerType, sample_time: float) -> None:
        self._capsule: bytes | None = None
        self._kind = kind
        self._unpack = _UNPACK.get(kind)
        self._widest_q8 = 360.0 * _FASTEST * 40 * sample_time * 256.0
        self._was_first = False

    def feed(self, frame: bytes) -> Samples | None:
        """Decode a frame of `FrameFinder`; None while there is nothing yet, or the frame was spoilt."""
        if not frame:
            self._capsule = None
            return None
        if self._kind is AnswerType.NODES:
            return nodes(frame)
        if self._kind is AnswerType.HQ:
            return hq_nodes(frame)
        before, self._capsule = self._capsule, frame
        at = _START_AT.get(self._kind, 2)
        if frame[at + 1] & 0x80:
            self._was_first = False
            return _nothing(is_new_scan=True)
        return None if before is None else self._decode(before, frame, at)

    def _decode(self, before: bytes, after: bytes, at: int) -> Samples | None:
        start_q6 = int.from_bytes(before[at : at + 2], "little") & 0x7FFF
        end_q6 = int.from_bytes(after[at : at + 2], "little") & 0x7FFF
        span_q8 = (end_q6 - start_q6) << 2
        if start_q6 > end_q6:
            span_q8 += _TURN_Q8
        if self._kind is AnswerType.DENSE and span_q8 > self._widest_q8:
            return None
        assert self._unpack is not None
        distance, quality, offset_q16, step_q16 = self._unpack(before, after, span_q8)
        raw = (start_q6 << 10) + step_q16 * np.arange(len(distance))
        angle_q6 = (raw - offset_q16) >> 10
        ahead = (raw + step_q16) % _TURN_Q16
        if self._kind in (AnswerType.EXPRESS, AnswerType.ULTRA):
            is_first = ahead < step_q16
        else:
            is_first = self._edges(ahead < 2 * step_q16)
        return Samples((angle_q6 % _TURN_Q6 << 8) // 90, distance, quality, is_first)

    def _edges(self, is_near: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The first of each run of samples near the start of a turn."""
        before = np.concatenate(([self._was_first], is_near[:-1]))
        self._was_first = bool(is_near[-1])
        return is_near & ~before


def nodes(block: bytes) -> Samples:
    """Standard nodes, five bytes each."""
    raw = np.frombuffer(block, np.uint8).reshape(-1, NODE_SIZE).astype(np.int64)
    angle_q6 = (raw[:, 1] | raw[:, 2] << 8) >> 1
    return Samples((angle_q6 << 8) // 90, raw[:, 3] | raw[:, 4] << 8, raw[:, 0] & 0xFC, (raw[:, 0] & 1) == 1)


def hq_nodes(frame: bytes) -> Samples:
    """The 96 nodes of an HQ frame."""
    raw = np.frombuffer(frame, _NODE_HQ, 96, offset=9)
    angle, distance, quality = (raw[name].astype(np.int64) for name in ("angle", "distance", "quality"))
    return Samples(angle, distance, quality, (raw["flag"] & 1) == 1)


def _nothing(*, is_new_scan: bool) -> Samples:
    none = np.zeros(0, np.int64)
    return Samples(none, none, none, np.zeros(0, np.bool_), is_new_scan)


# Each gives, of a capsule: distances, qualities, offsets of the angle [2^-16 degrees], step of the raw angle likewise.
_Unpacked = tuple[Ints, Ints, "Ints | int", int]


def _express(before: bytes, _: bytes, span_q8: int) -> _Unpacked:
    cabins = np.frombuffer(before, _CABIN, 16, offset=4)
    pairs = np.stack((cabins["first"], cabins["second"]), axis=1).astype(np.int64)
    low = cabins["low"].astype(np.int64)
    offset_q3 = np.stack((low & 15, low >> 4), axis=1) | (pairs & 3) << 4
    distance = (pairs & 0xFFFC).ravel()
    return distance, _hits(distance), offset_q3.ravel() << 13, span_q8 << 3


def _ultra(before: bytes, after: bytes, span_q8: int) -> _Unpacked:
    distance = ultra.distances(before, after)
    return distance, _hits(distance), ultra.angle_offsets(distance), (span_q8 << 3) // 3


def _dense(before: bytes, _: bytes, span_q8: int) -> _Unpacked:
    distance = np.frombuffer(before, "<u2", 40, offset=4).astype(np.int64) << 2
    return distance, _hits(distance), 0, (span_q8 << 8) // 40


def _ultra_dense(before: bytes, _: bytes, span_q8: int) -> _Unpacked:
    cabins = np.frombuffer(before, _CABIN, 32, offset=10)
    high = cabins["low"].astype(np.int64)
    coded = np.stack((cabins["first"] | (high & 15) << 16, cabins["second"] | (high >> 4) << 16), axis=1).ravel()
    distance, quality = _scaled(coded)
    return distance, quality, 0, (span_q8 << 8) // 64


def _hits(distance: Ints) -> Ints:
    return np.where(distance > 0, _HIT, 0)


def _scaled(coded: Ints) -> tuple[Ints, Ints]:
    """Distances and qualities in 20 bits each: the two lowest choose among four ranges, the nearest the finest."""
    scale = coded & 3
    mask = (0x1000 << scale) - 4
    distance = (coded & mask) * np.array([2, 3, 4, 5])[scale] + 4 * np.array([0, 2046, 8187, 24567])[scale]
    quality = coded >> 12 + scale << scale
    last = 0
    for at, (value, near) in enumerate(zip(distance.tolist(), (scale == 0).tolist(), strict=True)):
        last = (value + last) >> 1 if near and abs(value - last) <= 8 else value
        distance[at] = last
    return distance, quality


_UNPACK: dict[AnswerType, Callable[[bytes, bytes, int], _Unpacked]] = {
    AnswerType.EXPRESS: _express,
    AnswerType.ULTRA: _ultra,
    AnswerType.DENSE: _dense,
    AnswerType.ULTRA_DENSE: _ultra_dense,
}
