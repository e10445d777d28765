"""Photographs with labelled persons, and what is made of them: dark ones, and crops that show only legs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
PEOPLE = ROOT.parent / "shared" / "people"
LIGHT = 0.1
NOISE = 3.0
"""Standard deviation of the noise of dark pictures [levels of 255], each value by itself."""
HIP = 0.55
"""Where crops of legs begin, as a share of the person's height from the top of the head: just below the hip."""
BELOW_FEET = 0.05
"""Floor below the feet in such a crop, as a share of the person's height."""
UPRIGHT = 1.8
"""Least height by width of somebody who stands and is seen whole."""
BIG = 0.3
BORDER = 2.0


@dataclass(frozen=True)
class Photograph:
    """A photograph.

    Args:
        name: of its file.
        pixels: blue, green, red, shape (rows, columns, 3).
        persons: boxes x0, y0, x1, y1 [px], shape (N, 4).
    """

    name: str
    pixels: NDArray[np.uint8]
    persons: NDArray[np.float64]


def find_people(folder: Path | None) -> Path:
    """The folder of photographs; ends with a sentence if it is absent."""
    chosen = folder or PEOPLE
    if not (chosen / "coco.json").is_file():
        sys.exit(
            f"real_people.py: {chosen} has no coco.json; give the folder of the photographs, which are no part of the "
            "repository, with --people FOLDER"
        )
    return chosen


def read_set(folder: Path, name: str) -> list[Photograph]:
    """Read one set, "coco" or "pennfudan"; ends with a sentence if a picture is missing."""
    import cv2  # 98 MB, which a process that measures memory does without

    labels = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    found = []
    for file, label in labels.items():
        pixels = cv2.imread(str(folder / name / file), cv2.IMREAD_COLOR)
        if pixels is None:
            sys.exit(f"real_people.py: {folder / name / file} is missing or no picture")
        persons = np.array(label["persons"], dtype=np.float64).reshape(-1, 4)
        found.append(Photograph(file, np.asarray(pixels, dtype=np.uint8), persons))
    return found


def darken(photographs: list[Photograph], seed: int = 0) -> list[Photograph]:
    """The same with 10 % of the light and noise."""
    rng = np.random.default_rng(seed)
    dark = []
    for one in photographs:
        values = one.pixels * LIGHT + rng.normal(0.0, NOISE, one.pixels.shape)
        dark.append(Photograph(one.name, np.clip(np.round(values), 0, 255).astype(np.uint8), one.persons))
    return dark


def crop_legs(photographs: list[Photograph]) -> Iterator[Photograph]:
    """One picture, 4:3 where the photograph is wide enough, of the legs of each big whole person, in its middle."""
    for one in photographs:
        rows, columns = one.pixels.shape[:2]
        for x0, y0, x1, y1 in one.persons[_whole(one)]:
            top, bottom = int(y0 + HIP * (y1 - y0)), int(min(y1 + BELOW_FEET * (y1 - y0), rows))
            half = (bottom - top) * 2 / 3
            left, right = int(max((x0 + x1) / 2 - half, 0)), int(min((x0 + x1) / 2 + half, columns))
            legs = np.array([[x0 - left, 0, x1 - left, min(y1, bottom) - top]])
            yield Photograph(one.name, np.ascontiguousarray(one.pixels[top:bottom, left:right]), legs)


def _whole(one: Photograph) -> NDArray[np.bool_]:
    """Which persons are big, upright, and not cut by the upper, left or right border."""
    rows, columns = one.pixels.shape[:2]
    x0, y0, x1, y1 = one.persons.T
    big = (y1 - y0 >= BIG * rows) & (y1 - y0 >= UPRIGHT * (x1 - x0))
    inside: NDArray[np.bool_] = big & (x0 > BORDER) & (y0 > BORDER) & (x1 < columns - BORDER)
    return inside
