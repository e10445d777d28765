"""Selection of the static bodies near the robot: only these need to be in the physics."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_SLACK = 0.5  # the robot may move this far before the next selection [m]


class NearBodies:
    """Bodies by name with their bounds, and the selection near a moving point."""

    def __init__(self) -> None:
        self._reach = 0.5
        self._bounds: dict[str, NDArray[np.float64]] = {}
        self._table: NDArray[np.float64] | None = None  # bounds of all bodies, shape (N, 2, 3)
        self._near: set[str] = set()
        self._centre: tuple[float, float] | None = None

    def set_reach(self, reach: float) -> None:
        """Set the distance from the point within which a body matters [m]."""
        self._reach = reach
        self._centre = None

    def add(self, name: str, bounds: NDArray[np.float64]) -> None:
        """Add a body with its lowest and highest x, y, z, shape (2, 3)."""
        self._bounds[name] = bounds
        self._table = self._centre = None

    def remove(self, name: str) -> None:
        """Remove a body."""
        del self._bounds[name]
        self._near.discard(name)
        self._table = self._centre = None

    def update(self, x: float, y: float) -> tuple[list[str], list[str]]:
        """Names that have come near, and names that are no longer near, with the point at (x, y)."""
        if self._centre is not None and math.hypot(x - self._centre[0], y - self._centre[1]) <= _SLACK:
            return [], []
        self._centre = (x, y)
        if self._table is None:
            self._table = np.array(list(self._bounds.values())).reshape(-1, 2, 3)
        point = np.array([x, y])
        gap = np.maximum(np.maximum(self._table[:, 0, :2] - point, point - self._table[:, 1, :2]), 0.0)
        names = list(self._bounds)
        near = [names[i] for i in np.flatnonzero(np.hypot(gap[:, 0], gap[:, 1]) <= self._reach + 2.0 * _SLACK)]
        come = [name for name in near if name not in self._near]
        gone = sorted(self._near.difference(near))
        self._near = set(near)
        return come, gone
