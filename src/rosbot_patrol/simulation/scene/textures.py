"""Procedural textures: small pictures that multiply a material's colour, made from a seed, without files.

A texture repeats every `metres`, or, with `metres` 0, fills its face once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SIDE = 128
Field = NDArray[np.float64]


@dataclass(frozen=True)
class Texture:
    """A picture of shape (SIDE, SIDE, 3), uint8; white leaves the material's colour unchanged."""

    pixels: NDArray[np.uint8]
    metres: float = 1.0


def smooth_noise(rng: np.random.Generator, cells_x: int, cells_y: int) -> Field:
    """Noise between 0 and 1 that repeats at its edges, with `cells_x` by `cells_y` bumps, shape (SIDE, SIDE)."""
    grid = rng.random((cells_y, cells_x))
    y, x = np.arange(SIDE) * cells_y / SIDE, np.arange(SIDE) * cells_x / SIDE
    y0, x0 = y.astype(int), x.astype(int)
    fy, fx = (y - y0)[:, None], (x - x0)[None, :]
    fy, fx = fy * fy * (3 - 2 * fy), fx * fx * (3 - 2 * fx)
    y1, x1 = (y0 + 1) % cells_y, (x0 + 1) % cells_x
    top = grid[np.ix_(y0, x0)] * (1 - fx) + grid[np.ix_(y0, x1)] * fx
    low = grid[np.ix_(y1, x0)] * (1 - fx) + grid[np.ix_(y1, x1)] * fx
    field: Field = top * (1 - fy) + low * fy
    return field


def grey(field: Field, metres: float = 1.0) -> Texture:
    """A texture of brightness only."""
    levels = (np.clip(field, 0, 1) * 255).astype(np.uint8)
    return Texture(np.repeat(levels[:, :, None], 3, axis=2), metres)


def _plaster(rng: np.random.Generator) -> Texture:
    return grey(0.93 + 0.07 * smooth_noise(rng, 40, 40) - 0.06 * smooth_noise(rng, 5, 5), 1.5)


def _wood(rng: np.random.Generator) -> Texture:
    grain = smooth_noise(rng, 3, 50) * 0.6 + smooth_noise(rng, 6, 120) * 0.4
    plank = np.repeat(rng.uniform(0.78, 1.0, 8), SIDE // 8)[:, None]
    joint = np.where(np.arange(SIDE) % (SIDE // 8) == 0, 0.55, 1.0)[:, None]
    return grey((0.75 + 0.25 * grain) * plank * joint, 1.2)


def _tiles(rng: np.random.Generator) -> Texture:
    edge = np.minimum(np.arange(SIDE) % (SIDE // 4), 1)
    joint = np.where(edge[:, None] * edge[None, :] == 0, 0.6, 1.0)
    tone = np.kron(rng.uniform(0.85, 1.0, (4, 4)), np.ones((SIDE // 4, SIDE // 4)))
    return grey(joint * tone * (0.96 + 0.04 * smooth_noise(rng, 30, 30)), 1.6)


def _bricks(rng: np.random.Generator) -> Texture:
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    row = y // 16
    shifted = (x + (row % 2) * 16) % SIDE
    joint = (y % 16 < 2) | (shifted % 32 < 2)
    tone = rng.uniform(0.7, 1.0, (SIDE // 16, SIDE // 32))[row, shifted // 32]
    return grey(np.where(joint, 0.95, tone * (0.9 + 0.1 * smooth_noise(rng, 40, 40))), 1.0)


def _carpet(rng: np.random.Generator) -> Texture:
    return grey(0.8 + 0.2 * rng.random((SIDE, SIDE)) - 0.15 * smooth_noise(rng, 8, 8), 0.6)


def _stripes(rng: np.random.Generator) -> Texture:
    x = np.arange(SIDE) // (SIDE // 8) % 2
    return grey(np.tile(np.where(x == 0, 1.0, 0.55), (SIDE, 1)), 0.5)


def _checks(rng: np.random.Generator) -> Texture:
    x = np.arange(SIDE) // (SIDE // 8) % 2
    return grey(0.5 + 0.25 * (x[:, None] + x[None, :]), 0.4)


def _marble(rng: np.random.Generator) -> Texture:
    y, x = np.mgrid[0:SIDE, 0:SIDE] * (2 * np.pi / SIDE)
    wave = np.sin(2 * x + 3 * y + 5 * smooth_noise(rng, 5, 5))
    return grey(0.85 + 0.15 * wave, 1.2)


def _leaves(rng: np.random.Generator) -> Texture:
    return grey(0.45 + 0.55 * (smooth_noise(rng, 24, 24) > 0.5), 0.3)


def _denim(rng: np.random.Generator) -> Texture:
    return grey(0.85 + 0.1 * smooth_noise(rng, 60, 60) - 0.15 * smooth_noise(rng, 4, 4), 0.4)


def _books(rng: np.random.Generator) -> Texture:
    pixels = np.empty((SIDE, SIDE, 3), np.uint8)
    for shelf in range(4):
        x = 0
        while x < SIDE:
            width = int(rng.integers(3, 9))
            pixels[shelf * 32 : shelf * 32 + 32, x : x + width] = rng.integers(40, 230, 3)
            x += width
        pixels[shelf * 32 : shelf * 32 + 4] = 60
    return Texture(pixels, 1.0)


def _picture(rng: np.random.Generator) -> Texture:
    pixels = np.empty((SIDE, SIDE, 3), np.uint8)
    for channel in range(3):
        field = smooth_noise(rng, int(rng.integers(2, 6)), int(rng.integers(2, 6)))
        pixels[:, :, channel] = (40 + 215 * field).astype(np.uint8)
    for _ in range(int(rng.integers(2, 7))):
        x, y = rng.integers(0, SIDE - 20, 2)
        w, h = rng.integers(8, 60, 2)
        pixels[y : y + h, x : x + w] = rng.integers(0, 255, 3)
    pixels[:6] = pixels[-6:] = 50
    pixels[:, :6] = pixels[:, -6:] = 50
    return Texture(pixels, 0.0)


def _fur(rng: np.random.Generator) -> Texture:
    strands = 0.5 * smooth_noise(rng, 64, 16) + 0.5 * smooth_noise(rng, 32, 10)
    return grey(0.72 + 0.35 * strands - 0.1 * smooth_noise(rng, 6, 6), 0.12)


_MAKERS: dict[str, Callable[[np.random.Generator], Texture]] = {
    "plaster": _plaster,
    "wood": _wood,
    "tiles": _tiles,
    "bricks": _bricks,
    "carpet": _carpet,
    "stripes": _stripes,
    "checks": _checks,
    "marble": _marble,
    "leaves": _leaves,
    "denim": _denim,
    "books": _books,
    "picture": _picture,
    "fur": _fur,
}

NAMES = tuple(_MAKERS)


def standard_textures(seed: int = 7) -> dict[str, Texture]:
    """The textures that a material can name, in a fixed order."""
    return {name: make(np.random.default_rng([seed, i])) for i, (name, make) in enumerate(_MAKERS.items())}
