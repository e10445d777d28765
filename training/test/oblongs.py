"""Views of rooms of one colour with oblongs in them, for tests of what mixes views."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from training.learning.dataset import pack_masks
from training.learning.mixing import View
from training.pictures.labels import COLUMNS, HEIGHT, WIDTH

GREY, BLUE, RED = (90, 90, 90), (20, 40, 200), (200, 40, 20)


def make_view(*figures: tuple[int, int, tuple[int, int, int, int]], colour: tuple[int, int, int] = GREY) -> View:
    """A room of one colour with oblongs in it: kind (9: furniture), mask value, and x0, y0, x1, y1 [px]."""
    picture = np.full((HEIGHT, WIDTH, 3), colour, np.uint8)
    mask, rows = np.zeros((HEIGHT, WIDTH), np.uint8), []
    for kind, value, (x0, y0, x1, y1) in figures:
        picture[y0:y1, x0:x1] = (10 * value % 255, 255 - value, 30)
        mask[y0:y1, x0:x1] = value
        if kind != 9:
            row = dict.fromkeys(COLUMNS, 0.0) | {"kind": kind, "mask": value, "distance": 3.0, "light": 90.0}
            row |= {"x0": x0 / WIDTH, "x1": x1 / WIDTH, "y0": y0 / HEIGHT, "y1": y1 / HEIGHT, "contrast": 50.0}
            row |= {"seen_of_whole": 0.8, "seen_of_part": 1.0, "pixels": 4 * (x1 - x0) * (y1 - y0)}
            rows.append([row[name] for name in COLUMNS])
    return View(picture, np.array(rows, np.float32).reshape(-1, len(COLUMNS)), mask)


def write_shard(file: Path, count: int, colour: tuple[int, int, int] = GREY) -> None:
    """A shard of `count` times the same view with a person, with its labels and masks beside it."""
    view = make_view((0, 1, (40, 60, 90, 220)), colour=colour)
    rows = np.concatenate([view.rows + np.eye(1, view.rows.shape[1], dtype=np.float32) * k for k in range(count)])
    np.savez(file.with_suffix(".npz"), boxes=rows, **pack_masks(np.array([view.mask] * count)))
    np.save(file, np.array([view.picture] * count))
