"""Whole turns of the laser, gathered from its samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.drivers.rplidar.samples import Samples

MOST = 8192  # samples of a turn; later ones are lost, as in the maker's SDK


@dataclass(frozen=True)
class Turn:
    """One turn of the laser; arrays have the shape (N,).

    Attributes:
        angle: clockwise from the front of the device [rad], 0 to 2 pi.
        distance: [m], 0 for no echo.
        quality: 0 to 255.
    """

    angle: NDArray[np.float64]
    distance: NDArray[np.float64]
    quality: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.angle)


class Turns:
    """Cut samples into turns; what comes before the first whole turn is dropped.

    Attributes:
        lost: samples beyond the longest turn.
    """

    def __init__(self) -> None:
        self._parts: list[Samples] | None = None
        self._count = 0
        self.lost = 0

    def feed(self, samples: Samples) -> list[Turn]:
        """Take samples; returns the turns that they complete."""
        if samples.is_new_scan:
            self._parts, self._count = None, 0
        done = []
        begin = 0
        for first in np.flatnonzero(samples.is_first).tolist():
            self._add(samples, begin, first)
            if self._parts is not None and self._count:
                done.append(_turn(self._parts))
            self._parts, self._count, begin = [], 0, first
        self._add(samples, begin, len(samples.angle))
        return done

    def _add(self, samples: Samples, begin: int, end: int) -> None:
        if self._parts is None or begin == end:
            return
        kept = min(end, begin + MOST - self._count)
        self.lost += end - kept
        self._count += kept - begin
        part = slice(begin, kept)
        self._parts.append(
            Samples(samples.angle[part], samples.distance[part], samples.quality[part], samples.is_first[part])
        )


def _turn(parts: list[Samples]) -> Turn:
    angle, distance, quality = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("angle", "distance", "quality")
    )
    return Turn(angle * (2.0 * np.pi / 65536.0), distance / 4000.0, quality)
