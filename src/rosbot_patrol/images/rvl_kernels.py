"""RVL: depth pictures as runs of zeros and differences, four bits at a time (Wilson, "Fast Lossless Depth Image
Compression", ISS 2017). Words of 32 bits, little-endian, filled from their high end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel


@kernel("int64(uint16[::1], uint8[::1])")
def encode(values: NDArray[np.uint16], out: NDArray[np.uint8]) -> int:
    """Write values into `out`, which has room for 3 bytes per value and 16 more; returns the number of bytes used."""
    word, filled, at = 0, 0, 0
    i, previous, count = 0, 0, len(values)
    while i < count:
        zeros = i
        while zeros < count and values[zeros] == 0:
            zeros += 1
        others = zeros
        while others < count and values[others] != 0:
            others += 1
        # -2 and -1 stand for the two lengths, the rest for the values
        for k in range(zeros - 2, others):
            if k == zeros - 2:
                number = zeros - i
            elif k == zeros - 1:
                number = others - zeros
            else:
                current = int(values[k])
                difference = current - previous
                number = 2 * difference if difference >= 0 else -2 * difference - 1
                previous = current
            while True:
                nibble = number & 7
                number >>= 3
                if number:
                    nibble |= 8
                word = (word << 4) | nibble
                filled += 1
                if filled == 8:
                    for byte in range(4):
                        out[at + byte] = (word >> (8 * byte)) & 255
                    at += 4
                    word, filled = 0, 0
                if not number:
                    break
        i = others
    if filled:
        word <<= 4 * (8 - filled)
        for byte in range(4):
            out[at + byte] = (word >> (8 * byte)) & 255
        at += 4
    return at


@kernel("UniTuple(int64, 2)(uint8[::1], int64)")
def read_number(data: NDArray[np.uint8], at: int) -> tuple[int, int]:
    """Read the number at a nibble; returns it and the next nibble, which is -1 if the data end or are invalid."""
    nibbles = (len(data) // 4) * 8
    number, shift = 0, 0
    while at < nibbles and shift <= 30:
        nibble = (data[4 * (at // 8) + 3 - (at % 8) // 2] >> (4 if at % 2 == 0 else 0)) & 15
        at += 1
        number |= (nibble & 7) << shift
        shift += 3
        if nibble < 8:
            return number, at
    return number, -1


@kernel("int64(uint8[::1], uint16[::1])")
def decode(data: NDArray[np.uint8], out: NDArray[np.uint16]) -> int:
    """Read values into `out`; returns their number, -1 if the data end too soon or are invalid."""
    at, done, previous, count = 0, 0, 0, len(out)
    while done < count:
        for part in range(2):
            length, at = read_number(data, at)
            if at < 0 or length > count - done:
                return -1
            for _ in range(length):
                if part == 0:
                    out[done] = 0
                else:
                    number, at = read_number(data, at)
                    if at < 0:
                        return -1
                    previous += (number + 1) // -2 if number & 1 else number // 2
                    out[done] = previous & 65535
                done += 1
    return done
