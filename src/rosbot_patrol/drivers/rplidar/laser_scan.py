"""The scan of a turn, laid out as rplidar_ros publishes it, or with beams that never move.

The lidar turns clockwise and a scan counts counterclockwise. Its angle 0 lies at pi of the scan: frame `laser` looks to
the lidar's 180 degrees, as upstream's does.

Differs: by default a scan has the same angles in each turn, 2 pi / N apart from -pi on. Each sample stands in the cell
of its own angle. A cell without one takes the nearest sample if that is less than a cell away, else NaN.
Upstream spreads each sample over several cells, and stretches the angles by 1 / (N - 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.drivers.rplidar.turns import Turn

Floats = NDArray[np.float64]

TAU = math.tau
RANGE_MIN = 0.15  # [m]
_REACH = 0.9  # [cells] a sample fills an empty cell this near to it


@dataclass(frozen=True)
class Layout:
    """Angles, ranges and intensities of a scan.

    Attributes:
        ranges: [m], inf for no echo, NaN for no sample; shape (N,).
        intensities: 0 to 63; shape (N,).
    """

    angle_min: float
    angle_max: float
    angle_increment: float
    ranges: Floats
    intensities: Floats


def fixed_angles(turn: Turn, cells: int, *, inverted: bool = False) -> Layout:
    """A scan of `cells` beams from -pi on, whatever the turn.

    Args:
        turn: of the laser.
        cells: number of beams, at least 1.
        inverted: the lidar hangs upside down.
    """
    increment = TAU / cells
    angle = (turn.angle - math.pi) if inverted else (math.pi - turn.angle)
    place = (angle + math.pi) / increment
    nearest = np.rint(place).astype(np.int64)
    filled = _Cells(cells)
    for shift in (0, -1, 1):  # its own cell first, then the two beside it
        filled.offer(turn, nearest + shift, np.abs(place - nearest - shift))
    return Layout(-math.pi, math.pi - increment, increment, filled.ranges, filled.intensities)


class _Cells:
    """Cells of a scan, and how far from its middle each has its sample."""

    def __init__(self, count: int) -> None:
        self.ranges = np.full(count, math.nan)
        self.intensities = np.zeros(count)
        self._off = np.full(count, _REACH)

    def offer(self, turn: Turn, cell: NDArray[np.int64], off: Floats) -> None:
        """Give cells the samples that are nearer than what they have; of two as near, the nearer echo.

        Args:
            turn: its samples.
            cell: for each sample.
            off: distance of each from the middle of that cell [cells].
        """
        cell = cell % len(self.ranges)
        nearer = np.flatnonzero(off < self._off[cell])
        cell, off = cell[nearer], off[nearer]
        ranges = turn.distance[nearer]
        ranges[ranges <= 0.0] = math.inf
        order = np.lexsort((ranges, off))[::-1]  # the last one written to a cell stays there
        cell = cell[order]
        self.ranges[cell], self.intensities[cell] = ranges[order], turn.quality[nearer[order]] >> 2
        self._off[cell] = off[order]


def upstream_angles(turn: Turn, cells_wanted: int, *, inverted: bool = False, compensate: bool = True) -> Layout | None:
    """The scan that upstream's node would publish; None if no sample of the turn has an echo.

    Args:
        turn: of the laser.
        cells_wanted: samples of a turn by the mode's rate and the frequency.
        inverted: the data order is kept.
        compensate: upstream's `angle_compensate`.
    """
    sorted_ = ascending(turn)
    if sorted_ is None:
        return None
    hits = np.flatnonzero(sorted_.distance > 0.0)
    if compensate:
        distance, quality = _spread(sorted_, hits, cells_wanted)
        first, last = 0.0, TAU
    else:
        part = slice(int(hits[0]), int(hits[-1]) + 1)
        distance, quality = sorted_.distance[part], sorted_.quality[part]
        first, last = float(sorted_.angle[hits[0]]), float(sorted_.angle[hits[-1]])
    ranges = np.where(distance > 0.0, distance, math.inf)
    strength = (quality >> 2).astype(np.float64)
    is_reversed = last > first
    low, high = (math.pi - last, math.pi - first) if is_reversed else (math.pi - first, math.pi - last)
    if is_reversed != inverted:
        ranges, strength = ranges[::-1], strength[::-1]
    return Layout(low, high, (high - low) / max(len(ranges) - 1, 1), ranges, strength)


def ascending(turn: Turn) -> Turn | None:
    """The turn sorted by angle, as upstream's `ascendScanData` does; None without an echo.

    Samples without an echo count as evenly spaced around the first and the last with one.
    """
    hits = np.flatnonzero(turn.distance > 0.0)
    if len(hits) == 0:
        return None
    count = len(turn)
    step = TAU / count
    angle = turn.angle.copy()
    first, last = int(hits[0]), int(hits[-1])
    angle[:first] = np.maximum(angle[first] - step * np.arange(first, 0, -1), 0.0)
    angle[last + 1 :] = angle[last] + step * np.arange(1, count - last)
    lost = np.flatnonzero(turn.distance == 0.0)
    angle[lost] = (angle[0] + lost * step) % TAU
    order = np.argsort(angle, kind="stable")
    return Turn(angle[order], turn.distance[order], turn.quality[order])


def _spread(turn: Turn, hits: NDArray[np.int64], cells_wanted: int) -> tuple[Floats, NDArray[np.int64]]:
    """Upstream's compensation: each echo in all cells of the degree that it stands for."""
    per_degree = cells_wanted / 360.0 + 1.0
    cells = int(360.0 * per_degree)
    distance, quality = np.zeros(cells), np.zeros(cells, np.int64)
    at = (np.degrees(turn.angle[hits]) * per_degree).astype(np.int64)
    cell = np.minimum(at[:, np.newaxis] + np.arange(math.ceil(per_degree)), cells - 1).ravel()
    # one after another, so that a later sample overwrites an earlier one
    sample = np.repeat(hits, math.ceil(per_degree))
    distance[cell], quality[cell] = turn.distance[sample], turn.quality[sample]
    return distance, quality
