"""Typical sizes of boxes: k-means over the labels, by overlap of shapes, as YOLOv2's paper has it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from training.learning.dataset import Pictures, asked
from training.pictures.labels import HEIGHT, WIDTH, column


def find_anchors(pictures: Pictures, count: int, seed: int) -> NDArray[Any]:
    """Widths and heights [px of the network's input], by area, shape (count, 2)."""
    rows = np.concatenate([rows for shard in pictures.labels for rows in shard])
    rows = rows[asked(rows)]
    sizes = np.stack(
        [(column(rows, "x1") - column(rows, "x0")) * WIDTH, (column(rows, "y1") - column(rows, "y0")) * HEIGHT], 1
    )
    rng = np.random.default_rng(seed)
    centres = sizes[rng.choice(len(sizes), count, replace=False)]
    for _ in range(60):
        shared = np.minimum(sizes[:, None], centres[None]).prod(axis=2)
        overlap = shared / (sizes.prod(axis=1)[:, None] + centres.prod(axis=1)[None] - shared)
        nearest = overlap.argmax(axis=1)
        centres = np.array(
            [np.median(sizes[nearest == k], axis=0) if (nearest == k).any() else centres[k] for k in range(count)]
        )
    by_size: NDArray[Any] = centres[centres.prod(axis=1).argsort()]
    return by_size


def write_anchors(cfg: Path, anchors: NDArray[Any]) -> None:
    """Put anchors into a cfg file."""
    text = ", ".join(f"{w:.0f},{h:.0f}" for w, h in anchors)
    cfg.write_text(re.sub(r"(?m)^anchors\s*=.*$", f"anchors={text}", cfg.read_text()))
