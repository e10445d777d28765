"""The kinds of training pictures, and how many of each: what `render.py --kinds` draws, and `stream.py` in turns.

    python -m training.pictures.kinds SEED

names the sets that `render.py --kinds --seed SEED` draws, with commas between them.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Kind:
    """A kind of pictures.

    Attributes:
        stem: of its sets' names.
        parts: how many shards of it there are in a round of all kinds.
        offset: what is added to the seed, so that two kinds of one room do not show the same.
        house: a house of `worlds/`, or "" for rooms by chance.
        told: what `Studio.shard` is told.
    """

    stem: str
    parts: int
    offset: int = 0
    house: str = ""
    told: dict[str, Any] = field(default_factory=dict)

    def name(self, seed: int) -> str:
        """Of its set with a seed."""
        return f"{self.stem}_{seed}"

    def world(self, worlds: Path) -> Path | None:
        """The file of its house in that folder; None for rooms by chance."""
        return worlds / f"{self.house}.world" if self.house else None


def _of_houses() -> list[Kind]:
    """Each house as it is, repainted, and with the cases by which a network errs."""
    kinds = []
    for house in ("house", "office", "flat"):
        kinds += [
            Kind(f"own_{house}", 1, 10, house, {"house_share": 1.0, "plain": True, "pets": 0.4, "hard": 0.4}),
            Kind(f"paint_{house}", 1, 20, house, {"house_share": 1.0, "pets": 0.3, "hard": 0.4}),
            Kind(f"case_{house}", 2, 30, house, {"house_share": 1.0, "plain": True, "cases": 1.0}),
        ]
    return kinds


KINDS = (
    *_of_houses(),
    Kind("case", 10, 30, told={"house_share": 0.0, "cases": 1.0}),
    Kind("vary", 20, told={"house_share": 0.0, "pets": 0.3, "hard": 0.35}),
)
MOST = max(kind.parts for kind in KINDS)


def main() -> None:
    """Name the sets from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seed", type=int)
    seed = parser.parse_args().seed
    sys.stdout.write(",".join(kind.name(seed) for kind in KINDS) + "\n")


if __name__ == "__main__":
    main()
