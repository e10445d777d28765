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


@kernel("void(uint8[::1], uint8[::1], int8[::1], uint8[::1])")
def expose(drawn: Bytes, exposed: Bytes, noise: NDArray[np.int8], seen: Bytes) -> None:
    """Expose colours and add noise, clipped to 0 to 255.

    Args:
        drawn: colours without noise, shape (N,).
        exposed: each colour after the exposure, shape (256,).
        noise: noise of each colour, shape (N,).
        seen: colours on return, shape (N,); may be `drawn` itself.
    """
    for i in range(drawn.shape[0]):
        value = np.int16(exposed[drawn[i]]) + np.int16(noise[i])
        seen[i] = np.uint8(min(max(value, np.int16(0)), np.int16(255)))


@kernel("void(uint8[:,::1], float64, float64, uint8[:,::1])")
def roll_and_smear(sharp: Bytes, slant: float, smear: float, seen: Bytes) -> None:
    """Compute what a rolling shutter records of a scene that moves sideways in the picture.

    A pixel is the mean of the row's colours over the way that they go during the exposure. Colours beyond the edge of
    the picture are those at its edge. All columns move alike; at the edge of a picture 60 degrees wide a turn would
    move them a third more.

    Args:
        sharp: picture at the time of its middle row, shape (H, 3 W), the colours of a pixel side by side.
        slant: way to the right from the first row to the last [px].
        smear: way during the exposure of a row, positive [px].
        seen: picture on return, shape (H, 3 W); not `sharp` itself.
    """
    high, values = sharp.shape
    half = 0.5 * max(smear, 1.0)
    pad = int(0.5 * abs(slant) + half) + 2
    sums = np.zeros(values + 6 * pad + 3, np.int32)
    scale = np.float32(0.5 / half)
    for y in range(high):
        row, out = sharp[y], seen[y]
        for k in range(3 * pad):
            sums[k + 3] = sums[k] + row[k % 3]
        for k in range(values):
            sums[k + 3 * pad + 3] = sums[k + 3 * pad] + row[k]
        for k in range(3 * pad):
            sums[values + k + 3 * pad + 3] = sums[values + k + 3 * pad] + row[values - 3 + k % 3]
        middle = pad + 0.5 - slant * ((y + 0.5) / high - 0.5)
        left, right = int(middle - half), int(middle + half)
        u, v = np.float32(middle - half - left), np.float32(middle + half - right)
        before, next_before = sums[3 * left :], sums[3 * left + 3 :]
        after, next_after = sums[3 * right :], sums[3 * right + 3 :]
        for k in range(values):
            inner = np.float32(after[k] - before[k])
            ends = v * np.float32(next_after[k] - after[k]) - u * np.float32(next_before[k] - before[k])
            out[k] = np.uint8((inner + ends) * scale + np.float32(0.5))


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
