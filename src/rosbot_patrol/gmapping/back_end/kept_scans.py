"""The scans of all updates, kept small: what the map is drawn anew from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.gmapping.beams import Beams

Array = NDArray[np.float64]


class _Kept(NamedTuple):
    ends: NDArray[np.float32]
    is_hit: NDArray[np.bool_]
    sensor: Array
    spacing: float


class KeptScans:
    """Scans in their order."""

    def __init__(self) -> None:
        self._scans: list[_Kept] = []

    def __len__(self) -> int:
        return len(self._scans)

    def add(self, beams: Beams) -> None:
        """Keep a scan."""
        self._scans.append(_Kept(beams.ends.astype(np.float32), beams.is_hit, beams.sensor, beams.spacing))

    def __iter__(self) -> Iterator[Beams]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Beams:
        kept = self._scans[index]
        ends = kept.ends.astype(np.float64)
        rays = ends - kept.sensor
        lengths = np.maximum(np.hypot(*rays.T), 1e-9)
        return Beams(ends, rays / lengths[:, None], kept.is_hit, kept.sensor, kept.spacing)
