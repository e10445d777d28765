"""Patterns by chance for what training pictures show: another set for every shard, so that none can be learnt.

A network that sees the same dozen textures for ever takes an unknown wallpaper for a person. Families: waves, bumps,
scattered shapes, stripes, blocks; in grey or in a few colours; of any scale. The patterns of the tests (`test_set.py`)
are of other families.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from rosbot_patrol.simulation.scene.textures import SIDE, Field, Texture, smooth_noise, standard_textures

KEEP = 0.35


def draw_textures(rng: np.random.Generator) -> dict[str, Texture]:
    """For each name that materials use, its usual kind of another seed, or any pattern."""
    usual = standard_textures(int(rng.integers(1 << 30)))
    return {name: texture if rng.random() < KEEP else draw_pattern(rng) for name, texture in usual.items()}


def draw_pattern(rng: np.random.Generator) -> Texture:
    """Any pattern."""
    field = _FAMILIES[int(rng.integers(len(_FAMILIES)))](rng)
    if rng.random() < 0.25:
        field = field * _FAMILIES[int(rng.integers(len(_FAMILIES)))](rng)
    field = (field - field.min()) / max(float(np.ptp(field)), 1e-6)
    if rng.random() < 0.35:
        levels = int(rng.integers(2, 5))
        field = np.floor(np.clip(field, 0, 0.999) * levels) / (levels - 1)
    metres = float(np.exp(rng.uniform(np.log(0.15), np.log(3.0))))
    contrast = float(rng.choice([0.1, 0.25, 0.5, 0.8]))
    if rng.random() < 0.6:
        shades = np.repeat((1 - contrast + contrast * field)[:, :, None], 3, axis=2)
    else:
        colours = 1 - contrast * rng.random((4, 3))
        place = np.clip(field, 0, 0.999) * 3
        low = place.astype(int)
        part = (place - low)[:, :, None]
        shades = colours[low] * (1 - part) + colours[low + 1] * part
    shades = shades * (1 - rng.uniform(0, 0.15) * rng.random((SIDE, SIDE, 1)))
    return Texture((np.clip(shades, 0, 1) * 255).astype(np.uint8), metres)


def _waves(rng: np.random.Generator) -> Field:
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    warp = rng.choice([0.0, 0.3, 1.5]) * smooth_noise(rng, 4, 4)
    field: Field = np.zeros((SIDE, SIDE))
    for _ in range(int(rng.integers(1, 6))):
        fx, fy = rng.integers(-10, 11, 2)
        field = field + np.sin(2 * np.pi * (fx * x + fy * y + rng.random() + warp))
    return field


def _bumps(rng: np.random.Generator) -> Field:
    cells = np.exp(rng.uniform(np.log(2), np.log(64), 2)).astype(int)
    field = smooth_noise(rng, int(cells[0]), int(cells[1]))
    for _ in range(int(rng.integers(0, 3))):
        cells = np.minimum(cells * 2, 64)
        field = field + 0.5 * smooth_noise(rng, int(cells[0]), int(cells[1]))
    return field


def _shapes(rng: np.random.Generator) -> Field:
    canvas = np.full((SIDE, SIDE), float(rng.random()), np.float32)
    count, size = int(np.exp(rng.uniform(np.log(3), np.log(120)))), rng.uniform(3, 40)
    for _ in range(count):
        x, y = (int(v) for v in rng.integers(0, SIDE, 2))
        a, b = (max(int(v), 1) for v in rng.uniform(0.2, 1, 2) * size)
        tone, thick = float(rng.random()), -1 if rng.random() < 0.7 else int(rng.integers(1, 4))
        kind = rng.random()
        if kind < 0.3:
            cv2.ellipse(canvas, (x, y), (a, b), float(rng.uniform(0, 180)), 0, 360, tone, thick)
        elif kind < 0.55:
            cv2.rectangle(canvas, (x, y), (x + a, y + b), tone, thick)
        elif kind < 0.8:
            points = np.array([x, y]) + rng.uniform(-size, size, (int(rng.integers(3, 7)), 2))
            cv2.fillPoly(canvas, [points.astype(np.int32)], tone)
        else:
            cv2.line(canvas, (x, y), (x + int(rng.integers(-60, 61)), y + int(rng.integers(-60, 61))), tone, abs(thick))
    return canvas.astype(float)


def _stripes(rng: np.random.Generator) -> Field:
    edges = np.sort(rng.integers(0, SIDE, int(rng.integers(2, 24))))
    tones = rng.random(len(edges) + 1)[np.searchsorted(edges, np.arange(SIDE))]
    field: Field = np.tile(tones, (SIDE, 1))
    return field if rng.random() < 0.6 else field.T


def _blocks(rng: np.random.Generator) -> Field:
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    wide, high = int(rng.integers(6, 65)), int(rng.integers(6, 65))
    shift = (y // high) * int(rng.choice([0, wide // 2, rng.integers(0, wide)]))
    tone = rng.random((SIDE // high + 2, SIDE // wide + 40))[y // high, (x + shift) // wide % (SIDE // wide + 40)]
    joint = int(rng.integers(0, 4))
    return np.where((y % high < joint) | ((x + shift) % wide < joint), float(rng.random()), 0.4 + 0.6 * tone)


_FAMILIES: tuple[Callable[[np.random.Generator], Field], ...] = (_waves, _bumps, _shapes, _shapes, _stripes, _blocks)
