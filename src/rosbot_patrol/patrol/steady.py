"""A clock that only goes forward, made from one that may be set: an hour forward or back is no time that has passed."""

from __future__ import annotations

import math

LONGEST_STEP = 5.0  # [s] between two steps; more is a clock that was set, or a program that was held
BACKWARDS = 1.0  # [s]; less is two machines' disagreement


class SteadyClock:
    """Adds up the time between steps.

    Attributes:
        time: since the first step [s].
        jump: by how much the clock was set just now [s], 0 where it was not.
    """

    def __init__(self) -> None:
        self.time = 0.0
        self.jump = 0.0
        self._last: float | None = None

    def step(self, now: float) -> float:
        """Go on to `now` [s]; returns how much time has passed."""
        gap = 0.0 if self._last is None else now - self._last
        self._last = now
        self.jump = gap if not -BACKWARDS <= gap <= LONGEST_STEP else 0.0
        passed = 0.0 if self.jump else max(gap, 0.0)
        self.time += passed
        return passed


class Heard:
    """When something was heard last, in the time of a `SteadyClock`, from stamps of the clock that may be set."""

    def __init__(self) -> None:
        self._raw: float | None = None
        self._at = -math.inf

    def steady(self, raw: float, now: float, steady_now: float) -> float:
        """The stamp in steady time.

        Args:
            raw: stamp of the newest [s]; infinite ones are handed back.
            now: by the same clock [s].
            steady_now: by the steady one [s].
        """
        if not math.isfinite(raw):
            return raw
        if raw != self._raw:
            age = max(now - raw, 0.0)
            # What came since the last step is not older than that, whatever the stamps say.
            self._at = steady_now - (age if self._raw is None else min(age, 1.0))
            self._raw = raw
        return self._at
