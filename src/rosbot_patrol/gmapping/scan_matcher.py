"""Scan matching into the particles' maps; poses are drawn from the improved proposal.

Grisetti, Stachniss, Burgard: Improved techniques for grid mapping with Rao-Blackwellized particle filters (2007). The
proposal's Gaussian comes from the curvature at the match and the odometry's prior, not from samples around it. The
weight of a beam is learned from the distances of matched beams to the walls: the better lidar and map are, the narrower
is the proposal. The odometry's errors are learned, too (`odometry_noise`).

The search climbs from the odometry's guess, and every particle's would end at the same wrong place if the scan hardly
overlaps the map or the odometry slipped. Where a scan fits worse than usual, the best particle's map is searched as a
whole around the guess, and all particles try from the place found there, too.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping import match_kernels as kernels
from rosbot_patrol.gmapping.beams import Beams
from rosbot_patrol.gmapping.loops.place_search import WallField
from rosbot_patrol.gmapping.motion_model import LEAST
from rosbot_patrol.gmapping.odometry_noise import OdometryNoise
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.gmapping.tile_kernels import TILE

Array = NDArray[np.float64]
Tables = NDArray[np.int32]

SEARCH_BEAMS = 90  # approximate number of beams in the search
HALVINGS = 2  # of the search's steps; the refinement does the rest
INDEPENDENT = 90  # number of beams with independent errors; more beams add no information about the pose
LEARNING = 0.05  # weight of one match in the beams' variance
NARROWEST = 0.04  # of that variance [cells2]: a fifth of a cell
GAIN = 2.5  # log-odds of a beam that fits a wall against one that does not
USUAL = 60  # matches over which the usual fit is taken
FIRST = 10  # of them, before which no match is doubted
DOUBTFUL = 0.95  # share of the usual fit below which the surroundings of the guess are searched
SEARCH_REACH, SEARCH_TURN = 0.5, 0.5  # around the guess [m, rad]
MOVED = 1.5 * LEAST[2]  # deviation of the turn from which the odometry's errors show [rad]
BETTER = 3.0  # how much likelier a match from the searched place must be, as a logarithm


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


class _Move(NamedTuple):
    """A move by the odometry, for each particle.

    Attributes:
        guesses: poses after it [cells, rad], shape (N, 3).
        headings: before it [rad], shape (N,).
        sigmas: standard deviations ahead, to the left [cells] and in turning [rad], by the parameters, shape (3,).
    """

    guesses: Array
    headings: Array
    sigmas: Array


class ScanMatcher:
    """Matches scans with gmapping's parameters.

    Args:
        params: of slam_gmapping.
    """

    def __init__(self, params: GmappingParams) -> None:
        self._params = params
        self.variance = kernels.WIDEST  # of the beams' distances from the walls, so far [cells2]
        self.noise = OdometryNoise()
        self._shares: deque[float] = deque(maxlen=USUAL)  # of the beams that fitted, in the best particle's map
        self._matched = 0

    def match(
        self,
        maps: ParticleMaps,
        guesses: Array,
        headings: Array,
        beams: Beams,
        deviation: Array,
        *,
        best: int,
        noise: Array,
    ) -> Matches:
        """Match a scan into each particle's map.

        Args:
            maps: of the particles.
            guesses: the odometry's poses [m, rad], shape (N, 3).
            headings: of the particles before the move [rad], shape (N,).
            beams: of the scan.
            deviation: of the odometry's move ahead, to the left [m] and in turning [rad], shape (3,).
            best: index of the best particle: its map is searched, and its match shows the odometry's error.
            noise: standard normal numbers, shape (N, 3).
        """
        hits = beams.hits
        hits[:, :2] /= maps.resolution
        sigmas = deviation / np.array([maps.resolution, maps.resolution, 1.0])
        move = _Move(maps.to_cells(guesses), np.ascontiguousarray(headings), sigmas)
        if self._matched == 0:  # match once to learn the beams' variance, because the first draws turn the whole map
            self._match(maps, move, hits, noise=noise)
        poses, fits = self._match(maps, move, hits, noise=noise)
        starts = move.guesses
        if self._is_doubtful(float(fits[best, 0]) / len(hits)):
            place = self._search(maps, best, move.guesses[best], hits)
            if place is not None:
                starts = move.guesses + (place - move.guesses[best])
                others, other_fits = self._match(maps, move, hits, starts, noise=noise)
                is_better = other_fits[:, 6] > fits[:, 6] + BETTER
                poses[is_better], fits[is_better] = others[is_better], other_fits[is_better]
        if deviation[2] > MOVED:
            self._learn(maps, move, hits, starts, best=best)
        return Matches(maps.from_cells(poses), maps.from_cells(fits[:, 2:5]), fits[:, 0], fits[:, 1])

    def _is_doubtful(self, share: float) -> bool:
        """Whether a share of fitting beams is less than usual; remembers it."""
        usual = float(np.median(np.array(self._shares))) if len(self._shares) >= FIRST else 0.0
        self._shares.append(share)
        return share < DOUBTFUL * usual

    def _search(self, maps: ParticleMaps, best: int, guess: Array, hits: Array) -> Array | None:
        """Where the scan fits best around a guess, in the best particle's map [cells, rad], shape (3,)."""
        reach = math.ceil(SEARCH_REACH / maps.resolution)
        far = float(np.hypot(hits[:, 0], hits[:, 1]).max()) + reach
        low = np.maximum(np.floor((guess[:2] - far) / TILE), 0).astype(np.int64)
        high = np.ceil((guess[:2] + far) / TILE).astype(np.int64)
        field = WallField(maps.walls(best, low, high), low * float(TILE), reach)
        return field.find(hits[:, :2], Pose2D(*guess), SEARCH_TURN)

    def _learn(self, maps: ParticleMaps, move: _Move, hits: Array, starts: Array, *, best: int) -> None:
        """Learn the odometry's errors: match once more in one map, as if they were as the parameters say."""
        one = slice(best, best + 1)
        alone = _Move(move.guesses[one], move.headings[one], move.sigmas)
        fits = self._run(maps.tables[one], maps, alone, hits, starts[one], np.ones(3), np.zeros((1, 3)))[1]
        x, y, turn = fits[0, 2:5] - move.guesses[best]
        c, s = math.cos(move.headings[best]), math.sin(move.headings[best])
        self.noise.learn(np.array([c * x + s * y, c * y - s * x, turn]) / move.sigmas)

    def _match(
        self, maps: ParticleMaps, move: _Move, hits: Array, starts: Array | None = None, *, noise: Array
    ) -> tuple[Array, Array]:
        """Poses and fits from `match_particles`; updates the beams' variance."""
        starts = move.guesses if starts is None else starts
        poses, fits = self._run(maps.tables, maps, move, hits, starts, self.noise.scale, noise)
        self._matched += 1
        share = max(LEARNING, 1.0 / self._matched)
        self.variance += share * (max(float(np.median(fits[:, 5])), NARROWEST) - self.variance)
        return poses, fits

    def _run(  # noqa: PLR0917 - the kernel's arguments
        self, tables: Tables, maps: ParticleMaps, move: _Move, hits: Array, starts: Array, scale: Array, noise: Array
    ) -> tuple[Array, Array]:
        poses, fits = np.empty_like(move.guesses), np.empty((len(move.guesses), 7))
        given = move.guesses, starts, hits, move.headings, move.sigmas, scale, noise
        kernels.match_particles(tables, maps.cells, *given, self._tuning(len(hits), maps.resolution), poses, fits)
        return poses, fits

    def _tuning(self, beams: int, resolution: float) -> Array:
        p, area = self._params, resolution * resolution
        alike = max(1.0, beams / INDEPENDENT)  # number of beams that count as one
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
                1.0 / (self.variance * alike),
                kernels.LONELY * self.variance,
                p.minimumScore,
                GAIN / alike,
            ]
        )
