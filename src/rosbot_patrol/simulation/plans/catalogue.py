"""Catalogue of furniture for drawn houses: which pieces stand in which kind of room, and how.

The pieces are those of our own houses' plans and those of config/furniture_catalogue.yaml, which also lists the rooms.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rosbot_patrol.errors import ParamError
from rosbot_patrol.yaml_files import read_mapping

CATALOGUE = "furniture_catalogue.yaml"
_PLANS = ("house_furniture.yaml", "flat_plan.yaml", "office_plan.yaml")
STANDS = ("wall", "free", "seat")


@dataclass(frozen=True)
class Wish:
    """A kind of piece that a room may have.

    Attributes:
        piece: its name.
        share: probability of each of them.
        most: how many there are at most.
        stands: with its back to a wall, free in the room, or as a seat at the piece before it.
    """

    piece: str
    share: float
    most: int
    stands: str


@dataclass(frozen=True)
class Catalogue:
    """Pieces by name, and the wishes of each kind of room; `homes` and `offices` are kinds of rooms."""

    pieces: dict[str, Any]
    rooms: dict[str, tuple[Wish, ...]]
    homes: tuple[str, ...]
    offices: tuple[str, ...]


def load_catalogue(config: Path) -> Catalogue:
    """Read the catalogue from the package's folder of configuration.

    Raises:
        ParamError: a file cannot be read, or names a piece that is not there.
    """
    path = config / CATALOGUE
    tree = read_mapping(path, keys="pieces, rooms, homes and offices")
    pieces: dict[str, Any] = {}
    for name in _PLANS:
        pieces |= read_mapping(config / name, keys="pieces")["pieces"]
    pieces |= tree["pieces"]
    rooms = {kind: tuple(_wish(entry, pieces, f"{path}: rooms/{kind}") for entry in tree["rooms"][kind])
             for kind in tree["rooms"]}  # fmt: skip
    return Catalogue(pieces, rooms, tuple(tree["homes"]), tuple(tree["offices"]))


def _wish(entry: list[Any], pieces: dict[str, Any], name: str) -> Wish:
    try:
        piece, share, most, stands = entry
        wish = Wish(str(piece), float(share), int(most), str(stands))
    except (TypeError, ValueError) as err:
        raise ParamError(name, f"expected [piece, share, most, stands], got {entry!r}") from err
    if wish.piece not in pieces:
        raise ParamError(name, f"'{wish.piece}' is no piece of the catalogue")
    if wish.stands not in STANDS:
        raise ParamError(name, f"'{wish.stands}' is not one of {', '.join(STANDS)}")
    return wish


def extent(piece: dict[str, Any]) -> tuple[float, float, float, float]:
    """Outline of a piece in its own frame: smallest and largest x and y [m]."""
    low, high = [math.inf, math.inf], [-math.inf, -math.inf]
    for part in piece["parts"]:
        for axis, half in enumerate(_half(part)):
            low[axis] = min(low[axis], part["at"][axis] - half)
            high[axis] = max(high[axis], part["at"][axis] + half)
    return low[0], high[0], low[1], high[1]


def _half(part: dict[str, Any]) -> tuple[float, float]:
    if part["shape"] == "turned":
        radius = max(float(point[0]) for point in part["profile"])
    elif part["shape"] == "box":
        x, y = part["size"][0] / 2.0, part["size"][1] / 2.0
        c, s = abs(math.cos(part.get("yaw", 0.0))), abs(math.sin(part.get("yaw", 0.0)))
        return c * x + s * y, s * x + c * y
    else:
        radius = float(part["size"][0])
    return radius, radius


_SIZES = (0.88, 1.15)  # by which factor a piece is made larger or smaller
_PAINT = 0.35  # largest share of another colour in a part's own
_TEXTURES = ("", "", "", "Wood", "WoodFloor", "Paper")


def varied(piece: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """A piece of another size, and in other colours: parts of one colour keep one colour."""
    made = copy.deepcopy(piece)
    factor = float(rng.uniform(*_SIZES))
    paints: dict[tuple[float, ...], tuple[list[float], str]] = {}
    for part in made["parts"]:
        part["at"] = [round(v * factor, 4) for v in part["at"]]
        if "size" in part:
            part["size"] = [round(v * factor, 4) for v in part["size"]]
        if "profile" in part:
            part["profile"] = [[round(r * factor, 4), round(z * factor, 4)] for r, z in part["profile"]]
        own = tuple(part["colour"])
        if own not in paints:
            paints[own] = _paint(own, rng), str(rng.choice(_TEXTURES))
        part["colour"], part["material"] = paints[own]
    return made


def _paint(own: tuple[float, ...], rng: np.random.Generator) -> list[float]:
    other, share = rng.random(3) * rng.uniform(0.2, 1.0), float(rng.uniform(0.0, _PAINT))
    if rng.random() < 0.25:
        share = 1.0  # another colour altogether
    mixed = (1.0 - share) * np.array(own) + share * other
    return [round(float(v), 3) for v in np.clip(mixed, 0.0, 1.0)]
