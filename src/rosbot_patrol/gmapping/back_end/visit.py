"""What was seen on a short way, as a small map in which what was seen on another way is looked for."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, invert, transform_points
from rosbot_patrol.gmapping.back_end import refine_kernels as kernels
from rosbot_patrol.gmapping.back_end.kept_scans import KeptScans
from rosbot_patrol.gmapping.back_end.pose_graph import relative_moves
from rosbot_patrol.gmapping.loops.place_search import WallField
from rosbot_patrol.gmapping.match_kernels import LONELY
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.gmapping.scan_matcher import INDEPENDENT, NARROWEST
from rosbot_patrol.gmapping.tile_kernels import TILE

Array = NDArray[np.float64]

FITTING = 2.0  # distance from a wall up to which the end of a beam fits [cells]
LIKE = 0.35  # least share of the best possible sum in the search: scans reach into what the map does not know
KNOWN = 0.5  # least share of the beams that end in what the map knows
FITS = 0.71  # of these, least share that ends on its walls, of both visits in the map of the other ...
ONE_WAY = 0.07  # ... or so much more of one alone: where people or doors moved, the other way fits less
MORE = 0.02  # and so much more for each metre of the search: the farther it looks, the more places are alike
MOST_HITS = 1500  # of a visit
TUNING = np.array([15.0, 3.0, LONELY, 1e-3, 1e-3, 1e-2])  # of refine_alone


class Place(NamedTuple):
    """Where a visit was found on the map of another.

    Attributes:
        pose: its anchor in the frame of the other's [m, rad].
        covariance: of the pose, in that frame, shape (3, 3).
    """

    pose: Pose2D
    covariance: Array


class Visit:
    """Some scans in the frame of one of their poses.

    Args:
        scans: of all updates.
        poses: of all updates, shape (U, 3).
        updates: which of them are the visit.
        anchor: one of them; its pose is the visit's frame.
        resolution: of the small map [m].
    """

    def __init__(self, scans: KeptScans, poses: Array, updates: range, anchor: int, resolution: float) -> None:
        self._scans = [scans[update] for update in updates]
        self._poses = relative_moves(poses, np.full(len(updates), anchor), np.array(updates))
        self._resolution = resolution

    @cached_property
    def _maps(self) -> ParticleMaps:
        low, high = self._poses[:, :2].min(axis=0) - 1.0, self._poses[:, :2].max(axis=0) + 1.0
        maps = ParticleMaps((low[0], low[1]), (high[0], high[1]), self._resolution, 1)
        for pose, beams in zip(self._poses, self._scans, strict=True):
            maps.register(pose[None], beams)
        return maps

    @cached_property
    def hits(self) -> Array:
        """Ends [cells], directions and normals, shape (H, 6)."""
        parts = []
        for pose, beams in zip(self._poses, self._scans, strict=True):
            hits, move = beams.hits, Pose2D(*pose)
            turned = [transform_points(Pose2D(0.0, 0.0, move.yaw), hits[:, k : k + 2]) for k in (2, 4)]
            parts.append(np.hstack((transform_points(move, hits[:, :2]) / self._resolution, *turned)))
        hits = np.concatenate(parts)
        return np.ascontiguousarray(hits[:: max(-(-len(hits) // MOST_HITS), 1)])

    def find(self, other: Visit, guess: Pose2D, reach: float, turn: float) -> Place | None:
        """Find another visit on the map of this one.

        Args:
            other: the visit to find.
            guess: where its anchor may be, in the frame of this one's.
            reach: how far from there [m].
            turn: how much it may be turned [rad].

        Returns:
            The place; None if the scans do not fit anywhere.
        """
        hits, maps = other.hits, self._maps
        if len(hits) == 0:
            return None
        start = maps.to_cells(np.array([guess]))[0]
        cells = math.ceil(reach / maps.resolution)
        far = float(np.hypot(hits[:, 0], hits[:, 1]).max()) + cells
        most = np.array(maps.tables.shape[:0:-1]) - 1  # a guess may lie off the map
        low = np.clip(np.floor((start[:2] - far) / TILE), 0, most).astype(np.int64)
        high = np.maximum(np.ceil((start[:2] + far) / TILE), low + 1).astype(np.int64)
        field = WallField(maps.walls(0, low, high), low * float(TILE), cells)
        found = field.find(np.ascontiguousarray(hits[:, :2]), Pose2D(*start), turn, least=LIKE)
        # the guess may be right, and a shift along a wall fit the coarse search better
        starts = [start] if found is None else [start, found]
        share, place = max((self._refine(other, each) for each in starts), key=lambda pair: pair[0])
        return place if share >= FITS + MORE * reach else None

    def _refine(self, other: Visit, cells: Array) -> tuple[float, Place | None]:
        """The share that fits, and the exact place from one in cells, shape (3,); None: the map knows too little."""
        hits, information = other.hits, np.empty((3, 3))
        kernels.refine_alone(self._maps.tables[0], self._maps.cells, cells, hits, TUNING, information)
        pose = Pose2D(*self._maps.from_cells(cells[None])[0])
        known, fitting, squares = self._fits(hits, pose)
        known_back, fitting_back, _ = other._fits(self.hits, invert(pose))
        both = (fitting + fitting_back) / max(known + known_back, 1.0)
        share = max(fitting / max(known, 1.0) - ONE_WAY, both)
        if known < KNOWN * len(hits):
            return share, None
        variance = max(squares / max(fitting, 1.0), NARROWEST)
        information /= variance * max(1.0, len(hits) / INDEPENDENT)
        metres = np.array([self._resolution, self._resolution, 1.0])
        return share, Place(pose, np.linalg.inv(information + np.diag(TUNING[3:])) * metres[:, None] * metres)

    def _fits(self, hits: Array, pose: Pose2D) -> Array:
        """Count hits from a pose on the map, see `count_fits`, shape (3,)."""
        counts = np.empty(3)
        cells = self._maps.to_cells(np.array([pose]))[0]
        kernels.count_fits(self._maps.tables[0], self._maps.cells, cells, hits, FITTING, counts)
        return counts
