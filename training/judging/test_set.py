"""The pictures that networks are tested on: what in them no training picture holds, and their seeds.

Half of the scenes are the villa in test/data/villa, whose plan and furniture are its own; half are rooms by chance.
Every texture is replaced, under the same name, by a pattern that training does not have (`unseen_textures`); people
have reserved looks and a reserved posture (`scenes.draw_person`), those on the posters too. All of this, and the seeds,
stood in the repository before the training whose weights are measured with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rosbot_patrol.simulation.scene.textures import SIDE, Field, Texture, grey, smooth_noise

WORLD = Path("test/data/villa/villa.world")


@dataclass(frozen=True)
class PictureSet:
    """How many pictures, from which seed; the share of scenes in the villa and of pictures with pets."""

    pictures: int
    seed: int
    house_share: float = 0.5
    pets: float = 0.2


TEST = PictureSet(pictures=2000, seed=90210)
FRESH = PictureSet(pictures=500, seed=77001)
SETS = {"test": TEST, "fresh": FRESH}


def unseen_textures(seed: int = 4242) -> dict[str, Texture]:
    """For each name that materials use, a pattern that no training picture has."""
    return {name: make(np.random.default_rng([seed, i])) for i, (name, make) in enumerate(_MAKERS.items())}


def unseen_picture(rng: np.random.Generator) -> Texture:
    """A framed picture: an evening sky over hills, another each time."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    sky, ground = rng.integers(40, 255, (2, 3)), rng.integers(20, 180, (2, 3))
    pixels = sky[0] + (sky[1] - sky[0]) * y[:, :, None]
    for level in (0.35, 0.6):
        hill = level + 0.1 * np.sin(2 * np.pi * (x * rng.uniform(0.5, 2.0) + rng.random())) - 0.1 * rng.random()
        pixels = np.where((1 - y < 1 - hill)[:, :, None], ground[0 if level < 0.5 else 1], pixels)
    sun = (x - rng.random()) ** 2 + (y - 0.25) ** 2 < rng.uniform(0.002, 0.02)
    pixels = np.where(sun[:, :, None], rng.integers(150, 255, 3), pixels)
    frame = rng.integers(20, 200, 3)
    edge = int(rng.integers(3, 10))
    pixels[:edge] = pixels[-edge:] = frame
    pixels[:, :edge] = pixels[:, -edge:] = frame
    return Texture(pixels[::-1].astype(np.uint8).copy(), 0.0)


def _grid() -> tuple[Field, Field]:
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    return y.astype(float), x.astype(float)


def _concrete(rng: np.random.Generator) -> Texture:
    holes = np.where(smooth_noise(rng, 60, 60) > 0.93, 0.75, 1.0)
    return grey(holes * (0.82 + 0.18 * smooth_noise(rng, 3, 9)), 2.3)


def _herringbone(rng: np.random.Generator) -> Texture:
    y, x = _grid()
    leg = ((x // 16).astype(int) % 2) * 2 - 1
    along = (y + leg * (x % 16)) % 16
    board = ((y + leg * (x % 16)) // 16).astype(int) % 8 * 8 + (x // 16).astype(int)
    tone = rng.uniform(0.7, 1.0, 64)[board]
    return grey(np.where((along < 1.2) | (x % 16 < 0.8), 0.5, tone * (0.9 + 0.1 * smooth_noise(rng, 40, 40))), 0.9)


def _hexagons(rng: np.random.Generator) -> Texture:
    y, x = _grid()
    side_x, side_y = SIDE / 4, SIDE / 4

    def nearest(shift: float) -> tuple[Field, Field]:
        cx: Field = (x + shift * side_x) % side_x - side_x / 2
        cy: Field = (y + shift * side_y) % side_y - side_y / 2
        return cx * cx + 0.75 * cy * cy, np.floor((x + shift * side_x) / side_x) + 7 * np.floor(y / side_y + shift)

    (near_a, cell_a), (near_b, cell_b) = nearest(0.0), nearest(0.5)
    cell = np.where(near_a < near_b, cell_a, cell_b + 31).astype(int) % 97
    joint = np.abs(near_a - near_b) < 22
    return grey(np.where(joint, 0.55, rng.uniform(0.8, 1.0, 97)[cell]), 1.1)


def _rubble(rng: np.random.Generator) -> Texture:
    points = rng.random((40, 2)) * SIDE
    y, x = _grid()
    offset = np.abs(np.stack([x, y], -1)[:, :, None] - points)
    away = np.sqrt((np.minimum(offset, SIDE - offset) ** 2).sum(-1))
    order = np.sort(away, axis=-1)
    tone = rng.uniform(0.6, 1.0, 40)[away.argmin(-1)] * (0.88 + 0.12 * smooth_noise(rng, 30, 30))
    return grey(np.where(order[..., 1] - order[..., 0] < 2.5, 0.4, tone), 1.5)


def _persian(rng: np.random.Generator) -> Texture:
    y, x = _grid()
    u, v = np.abs(x - SIDE / 2), np.abs(y - SIDE / 2)
    wave = np.sin(0.35 * (u + v)) + np.sin(0.22 * np.hypot(u, v)) + 0.5 * np.sin(0.5 * u) * np.sin(0.5 * v)
    band = np.where((np.maximum(u, v) > 52) & (np.maximum(u, v) < 56), 0.45, 1.0)
    return grey(band * (0.75 + 0.25 * np.sign(wave)) * (0.92 + 0.08 * rng.random((SIDE, SIDE))), 1.4)


def _damask(rng: np.random.Generator) -> Texture:
    y, x = _grid()
    a, b = 2 * np.pi * x / 32, 2 * np.pi * y / 64
    motif = np.cos(a) * np.cos(b) + 0.6 * np.cos(2 * a) * np.cos(b) ** 2 - 0.3 * np.cos(3 * b)
    return grey(np.where(motif > 0.25, 0.68, 1.0) - 0.04 * rng.random((SIDE, SIDE)), 0.8)


def _tartan(rng: np.random.Generator) -> Texture:
    lines = np.ones(SIDE)
    for start, width, tone in ((4, 18, 0.6), (30, 4, 0.3), (60, 30, 0.75), (70, 3, 0.35), (104, 10, 0.55)):
        lines[start : start + width] = tone
    twill = (np.add.outer(np.arange(SIDE), np.arange(SIDE)) // 2 % 2).astype(float)
    return grey(np.where(twill > 0, lines[:, None], lines[None, :]) * (0.95 + 0.05 * rng.random((SIDE, SIDE))), 0.5)


def _terrazzo(rng: np.random.Generator) -> Texture:
    chips = np.ones((SIDE, SIDE))
    y, x = _grid()
    for _ in range(120):
        cx, cy, radius = rng.random() * SIDE, rng.random() * SIDE, rng.uniform(1.0, 4.5)
        dx, dy = np.minimum(np.abs(x - cx), SIDE - np.abs(x - cx)), np.minimum(np.abs(y - cy), SIDE - np.abs(y - cy))
        chips[dx * rng.uniform(0.6, 1.6) + dy < radius] = rng.uniform(0.35, 0.85)
    return grey(chips, 0.8)


def _needles(rng: np.random.Generator) -> Texture:
    field = smooth_noise(rng, 64, 8) * 0.6 + smooth_noise(rng, 8, 64) * 0.4
    return grey(0.35 + 0.65 * (field > 0.52), 0.25)


def _knit(rng: np.random.Generator) -> Texture:
    y, x = _grid()
    stitch = np.abs(np.sin(np.pi * x / 8)) * (0.7 + 0.3 * np.sin(2 * np.pi * (y / 8 + np.abs((x % 16) - 8) / 12)))
    return grey(0.62 + 0.38 * stitch - 0.05 * rng.random((SIDE, SIDE)), 0.25)


def _folders(rng: np.random.Generator) -> Texture:
    pixels = np.full((SIDE, SIDE, 3), 45, np.uint8)
    for shelf in range(2):
        x = 0
        while x < SIDE:
            width, high = int(rng.integers(9, 18)), int(rng.integers(44, 60))
            colour = rng.integers(60, 250, 3) if rng.random() < 0.5 else np.repeat(rng.integers(20, 220), 3)
            pixels[shelf * 64 : shelf * 64 + high, x : x + width - 1] = colour
            pixels[shelf * 64 + 30 : shelf * 64 + 42, x + 2 : x + width - 3] = 235
            x += width
    return Texture(pixels, 0.8)


def _wool(rng: np.random.Generator) -> Texture:
    curls = np.abs(2.0 * smooth_noise(rng, 20, 20) - 1.0)
    return grey(0.55 + 0.6 * np.sqrt(curls) * (0.9 + 0.1 * rng.random((SIDE, SIDE))), 0.3)


_MAKERS: dict[str, Callable[[np.random.Generator], Texture]] = {
    "plaster": _concrete,
    "wood": _herringbone,
    "tiles": _hexagons,
    "bricks": _rubble,
    "carpet": _persian,
    "stripes": _damask,
    "checks": _tartan,
    "marble": _terrazzo,
    "leaves": _needles,
    "denim": _knit,
    "books": _folders,
    "picture": unseen_picture,
    "fur": _wool,
}
