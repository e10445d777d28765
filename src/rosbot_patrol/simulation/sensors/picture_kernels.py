"""Pixel kernels of the camera: depth from OpenGL's depth buffer, and the real sensor's noise and limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.kernels import kernel

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]


@kernel("void(float32[::1], float32, float32, float32[::1])")
def depth_from_clip(raw: Floats, near: float, far: float, metres: Floats) -> None:
    """Compute the depth of each pixel along the optical axis.

    Args:
        raw: values of the depth buffer, 0 at the near clip, 1 at the far one, shape (N,).
        near: near clip [m].
        far: far clip [m].
        metres: depth on return [m], shape (N,), inf at the far clip.
    """
    a, b = np.float32(near), np.float32(far)
    product, span = a * b, b - a
    for i in range(raw.shape[0]):
        metres[i] = product / (b - raw[i] * span) if raw[i] < np.float32(1.0) else np.float32(np.inf)


@kernel("void(uint8[::1], int8[::1], uint8[::1])")
def add_noise(drawn: Bytes, noise: NDArray[np.int8], seen: Bytes) -> None:
    """Add noise to colours, clipped to 0 to 255.

    Args:
        drawn: colours without noise, shape (N,).
        noise: noise of each colour, shape (N,).
        seen: colours on return, shape (N,); may be `drawn` itself.
    """
    for i in range(drawn.shape[0]):
        value = np.int16(drawn[i]) + np.int16(noise[i])
        seen[i] = np.uint8(min(max(value, np.int16(0)), np.int16(255)))


@kernel("void(float32[::1], float32[::1], float32, float32, float32[::1])")
def sense_depth(depth: Floats, noise: Floats, nearest: float, farthest: float, sensed: Floats) -> None:
    """Compute the sensor's depth: NaN outside its limits, with noise that grows with the square of the depth.

    Args:
        depth: exact depth, inf without a hit [m], shape (N,).
        noise: noise at a depth of 1 m [m], shape (N,) or (0,) for none.
        nearest: shortest measurable depth [m].
        farthest: longest measurable depth [m].
        sensed: depth on return [m], shape (N,).
    """
    noisy = noise.shape[0] > 0
    low, high = np.float32(nearest), np.float32(farthest)
    for i in range(depth.shape[0]):
        d = depth[i]
        if d < low or d > high:
            sensed[i] = np.float32(np.nan)
        elif noisy:
            sensed[i] = d + noise[i] * d * d
        else:
            sensed[i] = d
