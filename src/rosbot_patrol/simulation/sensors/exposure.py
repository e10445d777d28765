"""Automatic exposure: a gain that follows the brightness of the pictures with a delay, as a real camera's does."""

from __future__ import annotations

import math

TARGET = 115.0  # mean colour, of 255
GAINS = (0.4, 2.5)


class AutoExposure:
    """Finds the gain of each picture.

    Args:
        settling: time constant of the logarithm of the gain [s]; 0: at once.
    """

    def __init__(self, settling: float) -> None:
        self._settling = settling
        self._before: tuple[float, float] | None = None  # time, logarithm of the gain

    def gain(self, mean: float, now: float) -> float:
        """Gain for a picture.

        Args:
            mean: its mean colour before any gain, 0 to 255.
            now: time of the picture [s]; the first picture, and one from before the last, are exposed as wanted.
        """
        wanted = math.log(min(max(TARGET / max(mean, 1.0), GAINS[0]), GAINS[1]))
        if self._before is not None and self._settling > 0.0 and now >= self._before[0]:
            then, last = self._before
            wanted += (last - wanted) * math.exp(-(now - then) / self._settling)
        self._before = now, wanted
        return math.exp(wanted)
