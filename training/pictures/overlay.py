"""Patterns laid over what is no person in a training picture: walls and objects of any look, at no cost of drawing.

Where nothing is to be found a pattern may cover the whole picture, else only patches beside the boxes: what lies about
a person must not tell him by being plain.
"""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from training.pictures.patterns import draw_pattern

BANK = 300


@functools.cache
def pattern_bank() -> list[NDArray[Any]]:
    """The patterns, RGB, uint8, square, all of one size."""
    rng = np.random.default_rng(31)
    return [draw_pattern(rng).pixels for _ in range(BANK)]


def draw_from_bank(rng: np.random.Generator) -> NDArray[Any]:
    """Any pattern of the bank, RGB, uint8, square."""
    return pattern_bank()[int(rng.integers(BANK))]


def lay_patterns(picture: NDArray[Any], boxes: NDArray[Any], rng: np.random.Generator) -> NDArray[Any]:
    """The picture with patterns by chance.

    Args:
        picture: RGB, uint8, shape (H, W, 3); not changed.
        boxes: x0, y0, x1, y1 of what is to be found [px], shape (N, 4).
        rng: chance.
    """
    high, wide = picture.shape[:2]
    out = picture.copy()
    for _ in range(int(rng.integers(1, 4))):
        tall = rng.random() < 0.5
        w, h = (rng.uniform(0.05, 0.3), rng.uniform(0.2, 0.8)) if tall else rng.uniform(0.1, 0.9, 2)
        x, y = rng.uniform(-0.3 * w, 1 - 0.7 * w), rng.uniform(-0.3 * h, 1 - 0.7 * h)
        corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]) + rng.normal(0, 0.03, (4, 2))
        corners = (corners * [wide, high]).astype(np.float32)
        x0, y0 = np.maximum(corners.min(axis=0), 0).astype(int)
        x1, y1 = np.minimum(corners.max(axis=0), [wide, high]).astype(int)
        touches = (boxes[:, 0] < x1 + 3) & (boxes[:, 2] > x0 - 3) & (boxes[:, 1] < y1 + 3) & (boxes[:, 3] > y0 - 3)
        if x1 - x0 < 4 or y1 - y0 < 4 or touches.any():
            continue
        _lay(out[y0:y1, x0:x1], corners - np.array([x0, y0], np.float32), rng)
    return out


def _lay(part: NDArray[Any], corners: NDArray[Any], rng: np.random.Generator) -> None:
    pattern = draw_from_bank(rng)
    times = int(rng.choice([1, 1, 2, 3]))
    side = pattern.shape[0]
    pattern = np.tile(pattern, (times, times, 1)) if times > 1 else pattern
    start = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32) * times
    warp = cv2.getPerspectiveTransform(start, np.roll(corners, int(rng.integers(4)), axis=0))
    size = (part.shape[1], part.shape[0])
    laid = cv2.warpPerspective(pattern, warp, size, flags=cv2.INTER_LINEAR, borderValue=(255, 255, 255))
    if rng.random() < 0.35:  # a thing of its own colours instead of a pattern on what is there
        inside = cv2.fillConvexPoly(np.zeros(size[::-1], np.uint8), corners.astype(np.int32), 1)[:, :, None]
        tint = (rng.random(3) * rng.uniform(0.2, 1.0)).astype(np.float32)
        part[:] = np.where(inside > 0, (laid * tint).astype(np.uint8), part)
    else:
        part[:] = cv2.multiply(part, laid, scale=1 / 255.0)
