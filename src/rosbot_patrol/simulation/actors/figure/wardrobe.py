"""What a person wears, derived from the look: the same look always gives the same person."""

from __future__ import annotations

import functools
import zlib
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.simulation.actors.looks import Colour, Look

WHITE: Colour = (1.0, 1.0, 1.0)
_INNER: tuple[Colour, ...] = ((0.88, 0.88, 0.87), (0.42, 0.50, 0.64), (0.22, 0.22, 0.24))


@dataclass(frozen=True, kw_only=True)
class Outfit:
    """Details that a look leaves open.

    Attributes:
        seed: number of the person, for its folds and posture.
        curvy: 0 straight to 1: narrow waist, wide hips.
        front: of the top: plain, zip, buttons or open (over the colour `inner`).
        hem: height of the top's lower edge, in heights.
        jeans: whether the trousers have seams, pockets and worn thighs.
        sole, laces: colours of the shoes' parts.
        stubble: darkness of the beard, 0 to 1.
        collar: whether the top has one.
    """

    seed: int
    curvy: float
    front: str
    hem: float
    jeans: bool
    inner: Colour
    sole: Colour
    laces: Colour
    stubble: float
    collar: bool


@functools.lru_cache(maxsize=256)
def outfit_of(look: Look) -> Outfit:
    """Draw the outfit from the look's own values."""
    seed = zlib.crc32(repr((look.height, look.build, look.top, look.bottom, look.skin, look.hair_style)).encode())
    rng = np.random.default_rng(seed)
    womanly = look.hair_style == "long" or look.legs == "skirt"
    front = str(rng.choice(["plain", "zip", "buttons", "open"], p=[0.40, 0.22, 0.2, 0.18]))
    if look.sleeves == "short":
        front = "buttons" if front == "buttons" else "plain"
    if look.coat and front == "plain":
        front = "buttons"
    level = float(rng.choice([0.08, 0.85, 0.92, 0.3]))
    return Outfit(
        seed=seed,
        curvy=float(rng.uniform(0.6, 1.0)) if womanly else float(rng.uniform(0.0, 0.2)),
        front=front,
        hem=0.36 - 0.03 * float(rng.random()) if look.coat else float(rng.uniform(0.475, 0.525)),
        jeans=look.bottom_texture == "denim" or bool(rng.random() < 0.4),
        inner=_INNER[int(rng.integers(len(_INNER)))],
        sole=(level, level, 0.97 * level),
        laces=WHITE if rng.random() < 0.5 else (0.15, 0.15, 0.15),
        stubble=0.0 if womanly else float(np.clip(rng.normal(0.15, 0.3), 0.0, 0.8)),
        collar=front in ("buttons", "zip", "open") or bool(rng.random() < 0.2),
    )  # fmt: skip
