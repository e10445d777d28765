"""Noise that depends only on seed, sensor and sample, not on earlier listeners."""

from __future__ import annotations

import zlib

import numpy as np


def noise_of(seed: int, sensor: str, sample: int = 0) -> np.random.Generator:
    """Random generator for one sample of one sensor."""
    key = (seed & 0xFFFFFFFF) << 32 | zlib.crc32(sensor.encode())
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, 0, sample]))
