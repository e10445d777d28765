"""Looks of people: named, random, and reserved for tests.

The generator of training pictures uses `draw_look`, which never gives a reserved height, a reserved colour or a mask.
The system test's intruders have such looks: the network is tested on people that it has never seen.
"""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np

from rosbot_patrol.errors import WorldError

Colour = tuple[float, float, float]
RESERVED_HEIGHTS = (1.80, 1.84)
RESERVED_HUES = (0.72, 0.86)
HEIGHTS = (1.50, 1.95)


@dataclass(frozen=True, kw_only=True)
class Look:
    """The appearance of a person.

    Attributes:
        height: [m]; build: 1 is usual, 0.8 slight, 1.3 heavy.
        hair_style: short, long, bald, hood (in the top's colour), beanie or cap (in the hat's colour).
        mask: colour of a mask over the whole head, or None; reserved for tests.
        legs: trousers, shorts or skirt; sleeves: long or short; loose: 0 tight to 1 wide clothes.
        coat: the top extends down over the thighs.
        detailed: a figure of `actors/figure/`, with folds, face and fingers, instead of plain limbs.
    """

    name: str = "someone"
    height: float = 1.75
    build: float = 1.0
    top: Colour = (0.30, 0.35, 0.45)
    bottom: Colour = (0.18, 0.20, 0.28)
    skin: Colour = (0.80, 0.62, 0.52)
    hair: Colour = (0.16, 0.11, 0.07)
    shoes: Colour = (0.10, 0.09, 0.09)
    hat: Colour = (0.12, 0.12, 0.14)
    hair_style: str = "short"
    mask: Colour | None = None
    legs: str = "trousers"
    sleeves: str = "long"
    loose: float = 0.5
    coat: bool = False
    backpack: Colour | None = None
    top_texture: str = ""
    bottom_texture: str = ""
    detailed: bool = False


LOOKS: dict[str, Look] = {
    look.name: look
    for look in (
        Look(name="visitor", bottom_texture="denim", top=(0.55, 0.20, 0.16), bottom=(0.25, 0.33, 0.50)),
        Look(
            name="burglar",
            top=(0.09, 0.09, 0.10),
            bottom=(0.12, 0.12, 0.13),
            hair_style="beanie",
            backpack=(0.2, 0.2, 0.18),
        ),
        Look(
            name="woman",
            height=1.66,
            build=0.88,
            hair_style="long",
            hair=(0.35, 0.22, 0.10),
            legs="skirt",
            sleeves="short",
            top=(0.85, 0.82, 0.75),
            bottom=(0.50, 0.12, 0.15),
            skin=(0.85, 0.68, 0.58),
        ),
        Look(
            name="postman",
            height=1.78,
            coat=True,
            hair_style="cap",
            hat=(0.10, 0.15, 0.35),
            top=(0.12, 0.18, 0.38),
            backpack=(0.45, 0.33, 0.2),
        ),
        Look(
            name="jogger",
            height=1.72,
            build=0.85,
            legs="shorts",
            sleeves="short",
            loose=0.2,
            top=(0.95, 0.75, 0.10),
            bottom=(0.10, 0.10, 0.12),
            shoes=(0.9, 0.9, 0.9),
        ),
        Look(
            name="intruder_test_balaclava",
            height=1.82,
            build=1.05,
            top=(0.13, 0.13, 0.14),
            bottom=(0.20, 0.20, 0.21),
            mask=(0.10, 0.10, 0.11),
            hair_style="bald",
            loose=0.7,
        ),
        Look(
            name="intruder_test_violet",
            height=1.81,
            build=0.95,
            top=(0.45, 0.15, 0.75),
            bottom=(0.16, 0.16, 0.2),
            hair_style="hood",
        ),
        Look(
            name="intruder_test_orchid",
            height=1.83,
            build=1.15,
            top=(0.30, 0.30, 0.32),
            bottom=(0.60, 0.25, 0.70),
            hair_style="short",
            backpack=(0.40, 0.20, 0.60),
        ),
    )
}


def look_named(name: str) -> Look:
    """Find a look by its name.

    Raises:
        WorldError: there is no such look; the text lists the existing ones.
    """
    if name not in LOOKS:
        raise WorldError(name, f"is no look of a person; known are {', '.join(LOOKS)}")
    return LOOKS[name]


def is_reserved(look: Look) -> bool:
    """Whether a look is reserved for tests: its height, a mask, or a strong colour of a reserved hue."""
    coloured = [look.top, look.bottom, look.hat, look.shoes, *([look.backpack] if look.backpack else [])]
    tall = RESERVED_HEIGHTS[0] <= look.height <= RESERVED_HEIGHTS[1]
    return tall or look.mask is not None or any(_is_reserved_colour(c) for c in coloured)


def draw_look(rng: np.random.Generator) -> Look:
    """Draw a random look, never a reserved one."""
    height = float(rng.uniform(*HEIGHTS))
    while RESERVED_HEIGHTS[0] <= height <= RESERVED_HEIGHTS[1]:
        height = float(rng.uniform(*HEIGHTS))
    tone = float(rng.uniform(0.22, 1.0))
    skin = (0.88 * tone, (0.55 + 0.17 * tone) * tone, (0.42 + 0.18 * tone) * tone)
    top, bottom = _draw_colour(rng), _draw_colour(rng, trousers=True)
    return Look(
        height=height,
        build=float(np.clip(rng.normal(1.0, 0.13), 0.78, 1.4)),
        top=top,
        bottom=top if rng.random() < 0.06 else bottom,
        skin=skin,
        hair=_draw_hair(rng),
        shoes=_draw_colour(rng, trousers=True),
        hat=_draw_colour(rng),
        hair_style=str(
            rng.choice(["short", "long", "bald", "hood", "beanie", "cap"], p=[0.36, 0.22, 0.08, 0.1, 0.1, 0.14])
        ),
        legs=str(rng.choice(["trousers", "shorts", "skirt"], p=[0.74, 0.12, 0.14])),
        sleeves=str(rng.choice(["long", "short"], p=[0.65, 0.35])),
        loose=float(rng.random()),
        coat=bool(rng.random() < 0.15),
        backpack=_draw_colour(rng) if rng.random() < 0.12 else None,
        top_texture=str(rng.choice(["", "denim", "stripes", "checks", "carpet"], p=[0.6, 0.15, 0.1, 0.1, 0.05])),
        bottom_texture=str(rng.choice(["", "denim", "checks"], p=[0.6, 0.35, 0.05])),
    )


def _is_reserved_colour(colour: Colour) -> bool:
    hue, saturation, value = colorsys.rgb_to_hsv(*colour)
    return RESERVED_HUES[0] <= hue <= RESERVED_HUES[1] and saturation > 0.3 and value > 0.15


def _draw_colour(rng: np.random.Generator, *, trousers: bool = False) -> Colour:
    if rng.random() < (0.5 if trousers else 0.35):
        level = float(rng.choice([0.05, 0.08, 0.12, 0.2, 0.35, 0.6, 0.85, 0.95])) + float(rng.uniform(-0.03, 0.03))
        tint = rng.uniform(-0.02, 0.02, 3)
        red, green, blue = np.clip(level + tint, 0.01, 1.0)
        colour = (float(red), float(green), float(blue))
        return colour if not _is_reserved_colour(colour) else (level, level, level)
    hue = float(rng.uniform(0, 1 - (RESERVED_HUES[1] - RESERVED_HUES[0]) - 0.02))
    hue = hue if hue < RESERVED_HUES[0] - 0.01 else hue + (RESERVED_HUES[1] - RESERVED_HUES[0]) + 0.02
    saturation, value = float(rng.uniform(0.15, 1.0)), float(rng.uniform(0.08, 0.6 if trousers else 1.0))
    return colorsys.hsv_to_rgb(hue, saturation, value)


def _draw_hair(rng: np.random.Generator) -> Colour:
    shades = (
        (0.05, 0.04, 0.03),
        (0.16, 0.10, 0.06),
        (0.35, 0.22, 0.11),
        (0.75, 0.60, 0.35),
        (0.55, 0.25, 0.10),
        (0.65, 0.65, 0.65),
    )
    return shades[int(rng.integers(len(shades)))]
