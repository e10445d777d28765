"""What was seen on a short way, as a small map in which other scans are looked for."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping.back_end import refine_kernels as kernels
from rosbot_patrol.gmapping.back_end.kept_scans import KeptScans
from rosbot_patrol.gmapping.loops.place_search import WallField
from rosbot_patrol.gmapping.match_kernels import LONELY
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.gmapping.scan_matcher import INDEPENDENT, NARROWEST
from rosbot_patrol.gmapping.tile_kernels import TILE

Array = NDArray[np.float64]

FITTING = 2.0  # distance from a wall up to which the end of a beam fits [cells]
KNOWN, FITS = 0.5, 0.8  # least share of the beams that end in what the map knows; of these, on its walls
TUNING = np.array([15.0, 3.0, LONELY, 1e-3, 1e-3, 1e-2])  # of refine_alone


class Place(NamedTuple):
    """Where scans were found.

    Attributes:
        pose: on the map [m, rad].
        covariance: of the pose, in the map's axes, shape (3, 3).
    """

    pose: Pose2D
    covariance: Array


class Visit:
    """A small map.

    Args:
        scans: of all updates.
        poses: of all updates, shape (U, 3).
        updates: which of them the map is made of.
        resolution: of the map [m].
    """

    def __init__(self, scans: KeptScans, poses: Array, updates: range, resolution: float) -> None:
        places = poses[updates.start : updates.stop, :2]
        low, high = places.min(axis=0) - 1.0, places.max(axis=0) + 1.0
        self._maps = ParticleMaps((low[0], low[1]), (high[0], high[1]), resolution, 1)
        for update in updates:
            self._maps.register(poses[update : update + 1], scans[update])

    def find(self, hits: Array, guess: Pose2D, reach: float, turn: float) -> Place | None:
        """Find scans on the map.

        Args:
            hits: ends [cells], directions and normals in the robot's frame, shape (H, 6).
            guess: where the robot may be.
            reach: how far from it [m].
            turn: how much it may be turned [rad].

        Returns:
            The place; None if the scans do not fit anywhere.
        """
        maps = self._maps
        start = maps.to_cells(np.array([guess]))[0]
        cells = math.ceil(reach / maps.resolution)
        far = float(np.hypot(hits[:, 0], hits[:, 1]).max()) + cells
        low = np.maximum(np.floor((start[:2] - far) / TILE), 0).astype(np.int64)
        high = np.maximum(np.ceil((start[:2] + far) / TILE), low + 1).astype(np.int64)
        field = WallField(maps.walls(0, low, high), low * float(TILE), cells)
        found = field.find(np.ascontiguousarray(hits[:, :2]), Pose2D(*start), turn)
        return None if found is None else self._refine(hits, found)

    def _refine(self, hits: Array, pose: Array) -> Place | None:
        table, cells, information, counts = self._maps.tables[0], self._maps.cells, np.empty((3, 3)), np.empty(3)
        kernels.refine_alone(table, cells, pose, hits, TUNING, information)
        kernels.count_fits(table, cells, pose, hits, FITTING, counts)
        known, fitting, squares = counts
        if known < KNOWN * len(hits) or fitting < FITS * known:
            return None
        variance = max(squares / fitting, NARROWEST)
        information /= variance * max(1.0, len(hits) / INDEPENDENT)
        metres = np.array([self._maps.resolution, self._maps.resolution, 1.0])
        covariance = np.linalg.inv(information + np.diag(TUNING[3:])) * metres[:, None] * metres
        x, y, yaw = self._maps.from_cells(pose[None])[0]
        return Place(Pose2D(x, y, yaw), covariance)
