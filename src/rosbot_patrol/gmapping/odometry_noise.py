"""How large the odometry's errors really are, learned from matched scans.

The parameters say how large they may be. The tutorial's allow 11 degrees on a metre, ten times what wheels do, and a
prior as wide as that leaves the heading to chance wherever a scan hardly overlaps the map.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MEMORY = 60  # matches
DOUBTING = 15  # of them that say at the start that the parameters are right
OF_GAUSSIAN = 0.6745  # median of a Gaussian's absolute values, in standard deviations
NARROWEST = 0.01


class OdometryNoise:
    """Width of the odometry's errors ahead, to the left and in turning, as shares of the parameters'."""

    def __init__(self) -> None:
        self._errors = deque([np.full(3, OF_GAUSSIAN)] * DOUBTING, maxlen=MEMORY)
        self.scale: Array = np.ones(3)

    def learn(self, errors: Array) -> None:
        """Add how far a match, found without the narrow prior, lay from the guess.

        Args:
            errors: in standard deviations of the parameters' noise, shape (3,).
        """
        self._errors.append(np.abs(errors))
        self.scale = np.clip(np.median(np.array(self._errors), axis=0) / OF_GAUSSIAN, NARROWEST, 1.0)
