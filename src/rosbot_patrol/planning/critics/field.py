"""Distances over the local costmap, around what cannot be crossed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.costmap.costs import INSCRIBED, CostCells
from rosbot_patrol.grid import GridInfo
from rosbot_patrol.planning import potential_kernels

_CROSSING = np.ones(256, np.float32)
_CROSSING[INSCRIBED:] = np.inf


def distance_field(info: GridInfo, cells: CostCells, sources: NDArray[np.int64]) -> NDArray[np.float32]:
    """Distance to the nearest source cell [cells], inf where there is no way."""
    field = np.full(info.shape, np.inf, np.float32)
    inside = (sources >= 0).all(axis=1) & (sources < (info.width, info.height)).all(axis=1)
    starts = np.ascontiguousarray(sources[inside])
    if len(starts):
        zeros = np.zeros(len(starts), np.float32)
        limits = np.full([-(-n // potential_kernels.BLOCK) for n in info.shape], np.inf, np.float32)
        potential_kernels.propagate(cells, _CROSSING, starts, zeros, -1, -1, limits, field)
    return field
