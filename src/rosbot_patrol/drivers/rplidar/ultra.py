"""The ultra capsules of an A3: three distances in 32 bits, coded with a variable scale.

Each cabin holds the distance of its first sample; its resolution falls with distance. The second sample is coded
relative to this distance, the third relative to the first distance of the next cabin.

Source: behaviour of `handler_capsules.cpp` of Slamtec's SDK 2.1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

CABINS = 32
# (smallest code, smallest distance [mm], shift): each range of codes has half the resolution of the one before
SCALES = ((0, 0, 0), (512, 512, 1), (1280, 2048, 2), (1792, 4096, 3), (3328, 16384, 4))
_CODES, _DISTANCES, _SHIFTS = (np.array(column, np.int64) for column in zip(*SCALES, strict=True))
NO_ECHO = (-512, 511)  # predictions that say so
_NEAR = 200  # [mm / 4] nearer samples have a fixed offset
_DEGREES = 180.0 / math.pi


def decode(code: Ints) -> tuple[Ints, Ints]:
    """Distances [mm] and shifts of 12-bit codes."""
    at = np.searchsorted(_CODES, code, side="right") - 1
    return _DISTANCES[at] + ((code - _CODES[at]) << _SHIFTS[at]), _SHIFTS[at]


def encode(distance: Ints) -> tuple[Ints, Ints]:
    """Codes and shifts of distances [mm], as a device makes them."""
    at = np.searchsorted(_DISTANCES, distance, side="right") - 1
    return _CODES[at] + ((distance - _DISTANCES[at]) >> _SHIFTS[at]), _SHIFTS[at]


def distances(before: bytes, after: bytes) -> Ints:
    """The 96 distances of a capsule [mm / 4], 0 for no echo.

    Args:
        before: the capsule.
        after: the next one: its first cabin is the base of the last prediction.
    """
    words = np.frombuffer(before, "<u4", CABINS, offset=4).astype(np.int64)
    code = np.append(words, int.from_bytes(after[4:8], "little")) & 0xFFF
    base, shift = decode(code)
    own, own_shift, next_, next_shift = base[:-1], shift[:-1], base[1:], shift[1:]
    is_alone = (own == 0) & (next_ != 0)
    bases = np.stack((np.where(is_alone, next_, own), next_), axis=1)
    shifts = np.stack((np.where(is_alone, next_shift, own_shift), next_shift), axis=1)
    predicted = np.stack((words >> 12, words >> 22), axis=1) & 0x3FF
    predicted -= (predicted & 0x200) << 1  # ten bits with a sign
    later = np.where(np.isin(predicted, NO_ECHO), 0, (predicted << shifts) + bases)
    return np.maximum(np.column_stack((own, later)).ravel(), 0) << 2


def angle_offsets(distance: Ints) -> Ints:
    """How far the camera's view lies before the laser's angle [2^-16 degrees], for distances [mm / 4]."""
    inverse = 98361 // np.maximum(distance, _NEAR)
    far = int(8.0 * math.pi * 65536 / 180.0) - (inverse << 6) - inverse**3 // 98304
    near = int(7.5 * math.pi * 65536 / 180.0)
    return (np.where(distance >= _NEAR, far, near) * _DEGREES).astype(np.int64)
