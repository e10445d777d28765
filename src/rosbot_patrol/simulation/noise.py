"""Noise that depends on seed, sensor and sample only, not on earlier readers."""

from __future__ import annotations

import zlib

import numpy as np


def noise_of(seed: int, sensor: str, sample: int = 0) -> np.random.Generator:
    """Make the random generator of one sample of one sensor."""
    key = (seed & 0xFFFFFFFF) << 32 | zlib.crc32(sensor.encode())
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, 0, sample]))
