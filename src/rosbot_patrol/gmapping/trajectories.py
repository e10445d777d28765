"""Ancestry of the particles: poses and parents; the common past is stored once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

TIDY = 256  # number of updates between searches for the common past


class Trajectories:
    """The poses of all particles at each update."""

    def __init__(self) -> None:
        self._settled: list[Array] = []  # poses that all particles share, shapes (3,)
        self._poses: list[Array] = []  # shapes (N, 3)
        self._parents: list[Indices] = []  # into the update before, shapes (N,)

    def __len__(self) -> int:
        return len(self._settled) + len(self._poses)

    def add(self, poses: Array, parents: Indices) -> None:
        """Add an update: the poses, and the parent of each particle in the previous update."""
        self._poses.append(poses.copy())
        self._parents.append(parents.copy())
        if len(self._poses) > TIDY:
            self._settle()

    def restart(self, past: Array, poses: Array) -> None:
        """Give all particles one past, shape (U - 1, 3), and their last poses, shape (N, 3)."""
        self._settled, self._poses, self._parents = list(past), [], []
        self.add(poses, np.zeros(len(poses), dtype=np.int64))

    def of(self, index: int) -> Array:
        """Trajectory of one particle: a pose for each update, shape (U, 3)."""
        way: list[Array] = []
        for poses, parents in zip(reversed(self._poses), reversed(self._parents), strict=True):
            way.append(poses[index])
            index = int(parents[index])
        return np.array([*self._settled, *reversed(way)]).reshape(-1, 3)

    def _settle(self) -> None:
        """Move the common past of all particles to a single list."""
        alive = np.arange(len(self._poses[-1]))
        lines = [alive]
        for parents in reversed(self._parents):
            alive = np.unique(parents[alive])
            lines.append(alive)
        lines.reverse()  # lines[k + 1]: particles of update k with a living descendant
        common = 0
        while common < len(self._poses) - 1 and len(lines[common + 1]) == 1:
            self._settled.append(self._poses[common][lines[common + 1][0]])
            common += 1
        if common:
            del self._poses[:common], self._parents[:common]
            self._parents[0] = np.zeros_like(self._parents[0])
