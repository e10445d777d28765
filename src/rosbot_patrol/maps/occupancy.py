"""Conversion between grey values of a map's image and occupancy (-1 unknown, 0 to 100), as in map_server."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Mode = Literal["trinary", "scale", "raw"]
MODES: tuple[Mode, ...] = ("trinary", "scale", "raw")

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
GREY_FREE, GREY_OCCUPIED, GREY_UNKNOWN = 254, 0, 205


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """Conversion of grey to occupancy: darkness above `occupied` is a wall, below `free` is floor (0 to 1)."""

    occupied: float = 0.65
    free: float = 0.196
    negate: bool = False
    mode: Mode = "trinary"


def cells_from_picture(picture: NDArray[np.uint8], thresholds: Thresholds) -> NDArray[np.int8]:
    """Occupancy of each pixel, in the image's order of rows.

    Args:
        picture: shape (rows, columns) or (rows, columns, channels); the last of 2 or 4 channels is alpha.
        thresholds: how grey is read. `trinary` averages alpha in with the colours, as upstream does; `scale` leaves
            cells between the thresholds unknown where alpha is 0; `raw` takes the value as it is (255 is unknown).
    """
    if picture.ndim == 2:  # only 256 different values: use a table
        answers = _cells_of_greys(np.arange(256.0), np.ones(256, dtype=bool), thresholds)
        found: NDArray[np.int8] = answers[picture]
        return found
    has_alpha = picture.shape[2] in (2, 4)
    colours = picture[..., :-1] if has_alpha and thresholds.mode != "trinary" else picture
    is_opaque = picture[..., -1] > 0 if has_alpha else np.ones(picture.shape[:2], dtype=bool)
    return _cells_of_greys(colours.mean(axis=2), is_opaque, thresholds)


def _cells_of_greys(
    greys: NDArray[np.float64], is_opaque: NDArray[np.bool_], thresholds: Thresholds
) -> NDArray[np.int8]:
    if thresholds.negate:
        greys = 255.0 - greys
    if thresholds.mode == "raw":
        return greys.astype(np.uint8).view(np.int8)
    darkness = (255.0 - greys) / 255.0
    cells = np.full(greys.shape, UNKNOWN, dtype=np.int8)
    if thresholds.mode == "scale":
        between = is_opaque & (darkness >= thresholds.free) & (darkness <= thresholds.occupied)
        span = max(thresholds.occupied - thresholds.free, 1e-9)
        cells[between] = (1.0 + 98.0 * (darkness[between] - thresholds.free) / span).astype(np.int8)
    cells[darkness < thresholds.free] = FREE
    cells[darkness > thresholds.occupied] = OCCUPIED
    return cells


def picture_from_cells(cells: NDArray[np.int8], *, occupied: int = 65, free: int = 25) -> NDArray[np.uint8]:
    """Grey values as map_saver writes them: 0 to `free` is 254, `occupied` and above is 0, the rest 205."""
    picture = np.full(cells.shape, GREY_UNKNOWN, dtype=np.uint8)
    picture[cells >= occupied] = GREY_OCCUPIED
    picture[(cells >= 0) & (cells <= free)] = GREY_FREE
    return picture
