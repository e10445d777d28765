"""Scan matching into the particles' maps; poses are drawn from the improved proposal.

Grisetti, Stachniss, Burgard: Improved techniques for grid mapping with Rao-Blackwellized particle filters (2007). The
proposal's Gaussian comes from the curvature at the match and the odometry's prior, not from samples around it. The
weight of a beam is learned from the distances of matched beams to the walls: the better lidar and map are, the narrower
is the proposal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.gmapping import match_kernels as kernels
from rosbot_patrol.gmapping.beams import Beams
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.particle_map import ParticleMaps

Array = NDArray[np.float64]

SEARCH_BEAMS = 90  # approximate number of beams in the search
HALVINGS = 2  # of the search's steps; the refinement does the rest
INDEPENDENT = 90  # number of beams with independent errors; more beams add no information about the pose
LEARNING = 0.05  # weight of one match in the beams' variance
NARROWEST = 0.04  # of that variance [cells2]: a fifth of a cell


@dataclass(frozen=True)
class Matches:
    """Result of matching one scan for each particle.

    Attributes:
        poses: drawn from the proposal, shape (N, 3).
        modes: best-fitting poses, shape (N, 3).
        scores: of the matches, 0 for a failed one, shape (N,).
        log_likelihoods: of the scan there, shape (N,).
    """

    poses: Array
    modes: Array
    scores: Array
    log_likelihoods: Array


class ScanMatcher:
    """Matches scans with gmapping's parameters.

    Args:
        params: of slam_gmapping.
    """

    def __init__(self, params: GmappingParams) -> None:
        self._params = params
        self.variance = kernels.WIDEST  # of the beams' distances from the walls, so far [cells2]
        self._matched = 0

    def match(
        self, maps: ParticleMaps, guesses: Array, headings: Array, beams: Beams, deviation: Array, *, noise: Array
    ) -> Matches:
        """Match a scan into each particle's map.

        Args:
            maps: of the particles.
            guesses: the odometry's poses [m, rad], shape (N, 3).
            headings: of the particles before the move [rad], shape (N,).
            beams: of the scan.
            deviation: of the odometry's move ahead, to the left [m] and in turning [rad], shape (3,).
            noise: standard normal numbers, shape (N, 3).
        """
        hits = beams.hits
        hits[:, :2] /= maps.resolution
        sigmas = deviation / np.array([maps.resolution, maps.resolution, 1.0])
        given = maps.to_cells(guesses), hits, np.ascontiguousarray(headings)
        if self._matched == 0:  # match once to learn the beams' variance, because the first draws turn the whole map
            self._match(maps, *given, sigmas=sigmas, noise=noise)
        poses, fits = self._match(maps, *given, sigmas=sigmas, noise=noise)
        return Matches(maps.from_cells(poses), maps.from_cells(fits[:, 2:5]), fits[:, 0], fits[:, 1])

    def _match(
        self, maps: ParticleMaps, guesses: Array, hits: Array, headings: Array, *, sigmas: Array, noise: Array
    ) -> tuple[Array, Array]:
        """Poses and fits from `match_particles`; updates the beams' variance."""
        poses, fits = np.empty_like(guesses), np.empty((len(guesses), 6))
        tuning = self._tuning(len(hits), maps.resolution)
        kernels.match_particles(maps.tables, maps.cells, guesses, hits, headings, sigmas, noise, tuning, poses, fits)
        self._matched += 1
        share = max(LEARNING, 1.0 / self._matched)
        self.variance += share * (max(float(np.median(fits[:, 5])), NARROWEST) - self.variance)
        return poses, fits

    def _tuning(self, beams: int, resolution: float) -> Array:
        p, area = self._params, resolution * resolution
        return np.array(
            [
                p.lstep / resolution,
                p.astep,
                min(p.iterations, HALVINGS),
                max(2 * p.iterations, 1),
                max(beams // SEARCH_BEAMS, 1),
                p.kernelSize,
                p.sigma / area,
                p.lsigma / area,
                kernels.NULL / area,
                p.lskip + 1,
                1.0 / (self.variance * max(1.0, beams / INDEPENDENT)),
                kernels.LONELY * self.variance,
                p.minimumScore,
            ]
        )
