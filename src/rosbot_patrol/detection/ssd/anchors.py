"""Anchors of an SSD, as `ssd_anchor_generator` of TensorFlow's object-detection API makes them.

Liu et al., SSD: Single Shot MultiBox Detector, ECCV 2016, section 2.2: scales grow evenly from the finest feature map
to the coarsest. Each cell has a square anchor, one for each further aspect ratio, and a square of the geometric mean of
its scale and the next. The finest map has only three anchors, with a fixed scale of 0.1 for the square.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

ASPECT_RATIOS = (1.0, 2.0, 0.5, 3.0, 0.3333)
"""Width by height."""
FINEST = ((0.1, 1.0), (None, 2.0), (None, 0.5))
"""Scale and aspect ratio in the finest feature map; None: the smallest scale."""


def make_anchors(grids: Sequence[int], *, smallest: float = 0.2, largest: float = 0.95) -> NDArray[np.float32]:
    """Make the anchors of all feature maps, map by map, row by row, cell by cell.

    Args:
        grids: rows (and columns) of each square feature map, the finest first.
        smallest: scale of the finest map, as a share of the picture.
        largest: scale of the coarsest.

    Returns:
        Centre x, centre y, width, height, relative to the picture, shape (N, 4).
    """
    scales = [*np.linspace(smallest, largest, len(grids)), 1.0]
    shapes = [[(scale or smallest, ratio) for scale, ratio in FINEST]]
    for scale, following in itertools.pairwise(scales[1:]):
        shapes.append([*((scale, ratio) for ratio in ASPECT_RATIOS), ((scale * following) ** 0.5, 1.0)])
    return np.concatenate([_grid(cells, shape) for cells, shape in zip(grids, shapes, strict=True)])


def _grid(cells: int, shapes: Sequence[tuple[float, float]]) -> NDArray[np.float32]:
    """Anchors of one feature map; `shapes` are scale and aspect ratio."""
    sizes = [(scale * ratio**0.5, scale / ratio**0.5) for scale, ratio in shapes]
    centres = (np.arange(cells) + 0.5) / cells
    y, x = np.meshgrid(centres, centres, indexing="ij")
    out = np.empty((cells, cells, len(sizes), 4), dtype=np.float32)
    out[..., 0], out[..., 1], out[..., 2:] = x[..., None], y[..., None], sizes
    return out.reshape(-1, 4)
