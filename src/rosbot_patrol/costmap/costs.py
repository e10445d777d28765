"""Cost values, and their conversion to and from occupancy (costmap_2d's documented tables)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FREE = 0
INSCRIBED = 253
LETHAL = 254
UNKNOWN = 255

CostCells = NDArray[np.uint8]


def _occupancy_table() -> NDArray[np.int8]:
    table = np.empty(256, np.int8)
    table[FREE] = 0
    table[1:INSCRIBED] = 1 + (97 * (np.arange(1, INSCRIBED) - 1)) // 251
    table[INSCRIBED], table[LETHAL], table[UNKNOWN] = 99, 100, -1
    return table


OCCUPANCY_OF_COST = _occupancy_table()


def occupancy_of(cells: CostCells) -> NDArray[np.int8]:
    """Convert costs to an occupancy grid: 0, 1 to 98, 99 inscribed, 100 lethal, -1 unknown."""
    return OCCUPANCY_OF_COST[cells]


def costs_of_occupancy(
    occupancy: NDArray[np.int8],
    *,
    lethal_threshold: int = 100,
    unknown_value: int = -1,
    track_unknown: bool = True,
    trinary: bool = True,
) -> CostCells:
    """Convert an occupancy grid to costs.

    Args:
        occupancy: -1 unknown, 0 to 100.
        lethal_threshold: lowest occupancy of a lethal cell.
        unknown_value: the value for unknown, as a signed or unsigned byte.
        track_unknown: keep unknown cells apart from free ones.
        trinary: only free, lethal and unknown; otherwise values between are scaled.
    """
    value = np.arange(-128, 128)
    lethal_threshold = min(max(lethal_threshold, 0), 100)  # as upstream
    scaled = (np.clip(value, 0, None) / max(lethal_threshold, 1) * LETHAL).clip(0, LETHAL)
    table = np.zeros(256, np.uint8) if trinary else scaled.astype(np.uint8)
    # Upstream reads the bytes unsigned: 255 (that is -1) and everything else above the threshold is lethal.
    table[(value >= lethal_threshold) | (value < 0)] = LETHAL
    table[(value & 255) == (unknown_value & 255)] = UNKNOWN if track_unknown else FREE
    costs: CostCells = table[occupancy.astype(np.int16) + 128]
    return costs
