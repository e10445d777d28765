"""Houses drawn by chance from a seed, for campaigns and tests: layout, furniture, colours, and what was moved since.

The same seed gives the same house. Campaigns, tests and training take seeds from ranges of their own, so that no house
of one is seen by another: see `SEEDS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rosbot_patrol.simulation.plans.catalogue import Catalogue
from rosbot_patrol.simulation.plans.furnishing import Furnisher
from rosbot_patrol.simulation.plans.layout import Layout, Rect, draw_layout, plan_walls

SEEDS = {"campaign": (0, 1_000_000), "tests": (1_000_000, 1_001_000), "calibration": (2_000_000, 3_000_000)}
"""Ranges of seeds by their use; those from 9,000,000 on stay unused, for somebody else's trial."""

_MOST_MOVED = 4
_FLOORS = (("WoodFloor", 1.0), ("OakFloor", 1.0), ("Wood", 1.0), ("CeilingTiled", 0.8), ("Asphalt", 1.0), ("", 0.6))
_WALLS = ("PaintedWall", "PaintedWall", "PaintedWall", "", "", "Bricks", "Paper")


@dataclass(frozen=True, kw_only=True)
class DrawnHouse:
    """A drawn house, in the frame of its map: the robot waits at (0, 0).

    Attributes:
        plan: as it was when the map was made.
        plan_now: as it is: some furniture was moved.
        layout: rooms, doors and windows; names: of the rooms, the hall first.
    """

    seed: int
    plan: dict[str, Any]
    plan_now: dict[str, Any]
    layout: Layout
    names: tuple[str, ...]

    @property
    def rooms(self) -> tuple[tuple[str, Rect], ...]:
        """Name and outline of each room, the hall first."""
        return tuple(zip(self.names, self.layout.rooms, strict=True))


def draw_house(seed: int, catalogue: Catalogue, attempt: int = 0) -> DrawnHouse:
    """Draw a house.

    Args:
        seed: of all chance in it.
        catalogue: of furniture.
        attempt: draws another house, should the first one prove useless.
    """
    rng = np.random.default_rng([seed, 5, attempt])
    layout = draw_layout(rng)
    x, y = _home(layout, rng)
    layout = layout.moved(-x, -y)
    furnisher = Furnisher(layout, catalogue, rng)
    made = furnisher.furnish()
    floor, wall = str(_FLOORS[int(rng.integers(len(_FLOORS)))][0]), str(rng.choice(_WALLS))
    plan: dict[str, Any] = {
        "name": f"drawn_{seed}",
        "height": round(float(rng.uniform(2.3, 2.9)), 2),
        "head": round(float(rng.uniform(1.95, 2.15)), 2),
        "thickness": 0.1,
        "floor_colour": _tone(rng, 0.35, 0.75) if not floor else _tone(rng, 0.7, 1.0),
        "floor_material": floor,
        "wall_colour": _tone(rng, 0.65, 0.98),
        "wall_material": wall,
        "walls": plan_walls(layout),
        "pieces": made.pieces,
        "furniture": made.furniture,
    }
    moved = furnisher.moved(made, int(rng.integers(_MOST_MOVED + 1)))
    return DrawnHouse(
        seed=seed, plan=plan, plan_now={**plan, "furniture": moved}, layout=layout, names=_names(made.kinds)
    )


def _home(layout: Layout, rng: np.random.Generator) -> tuple[float, float]:
    """A place in the hall, away from its walls if it is long, else its middle."""
    hall = layout.rooms[0]
    margin = 0.8
    xs, ys = ((low + margin, high - margin) if high - low > 2.0 * margin else ((low + high) / 2.0,) * 2
              for low, high in ((hall.x0, hall.x1), (hall.y0, hall.y1)))  # fmt: skip
    return round(float(rng.uniform(*xs)), 2), round(float(rng.uniform(*ys)), 2)


def _tone(rng: np.random.Generator, low: float, high: float) -> list[float]:
    """A colour that is nearly grey."""
    level = float(rng.uniform(low, high))
    return [round(float(v), 3) for v in np.clip(level + rng.uniform(-0.08, 0.08, 3), 0.0, 1.0)]


def _names(kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the rooms: their kinds, numbered where there are several."""
    found: list[str] = []
    for i, kind in enumerate(kinds):
        number = kinds[: i + 1].count(kind)
        found.append(f"{kind} {number}" if kinds.count(kind) > 1 else kind)
    return tuple(found)
