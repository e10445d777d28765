"""Steady time: a clock that never goes back, made from one that may be set, and stamps converted to it.

All evidence of a mission uses steady time: `SteadyInputs` converts every stamp once, on arrival, and no other part of
the patrol needs to know that a clock can be set. Until the clock is first set, both times are equal.
"""

from __future__ import annotations

import dataclasses
import logging
import math
from collections import deque
from dataclasses import dataclass

from rosbot_patrol.patrol.records.inputs import Battery, Frame, Inputs, ScanView

log = logging.getLogger(__name__)

LONGEST_STEP = 5.0  # [s] between two steps; more means that the clock was set, or the program stopped
BACKWARDS = 1.0  # [s]; less is a difference between two machines
_PAUSE = 1.0  # [s] a longer step is this program's own pause: earlier inputs do not age by it
_LATE = 1.0  # [s] largest age of inputs since the last step, whatever their stamps say
_PERIODS = 20  # number of clock settings remembered
_AGE_COUNTS = 0.1  # weight of age: a slow detector is likelier than a picture from the future


@dataclass(frozen=True)
class _Period:
    """A period without a setting of the clock: steady time is clock time less `ahead`, from `since` on [s]."""

    ahead: float
    since: float


class SteadyClock:
    """Time without the jumps of the clock.

    Attributes:
        time: steady time [s]: the clock's at the first step, and what has passed since.
        passed: in the last step [s].
        jump: change of the clock's setting in the last step [s], 0: none.
    """

    def __init__(self) -> None:
        self.time = 0.0
        self.passed = 0.0
        self.jump = 0.0
        self.now = 0.0
        self._has_begun = False
        self._periods: deque[_Period] = deque([_Period(ahead=0.0, since=-math.inf)], maxlen=_PERIODS)

    def step(self, now: float) -> float:
        """Advance to `now` [s]; returns how much time has passed."""
        if not self._has_begun:
            self._has_begun, self.now, self.time = True, now, now
        gap, self.now = now - self.now, now
        self.jump = 0.0 if -BACKWARDS <= gap <= LONGEST_STEP else gap
        if 0.0 <= gap <= LONGEST_STEP:
            self.passed = gap
        else:  # the clock was set: assume that this step was as long as the previous one
            ahead = self._periods[-1].ahead + gap - self.passed
            self._periods.append(_Period(ahead=ahead, since=self.time))
        self.time = max(self.time, now - self._periods[-1].ahead)
        return self.passed

    def steady(self, stamp: float) -> float:
        """Convert a stamp of the clock, of about now, to steady time [s].

        After the clock was set, a stamp may be of the new clock, or of the old one for messages under way. The
        interpretation with the smaller deviation from its period is used.
        """
        if len(self._periods) == 1 or not math.isfinite(stamp):
            return stamp
        best, least, until = stamp, math.inf, self.time
        for period in reversed(self._periods):
            reading = stamp - period.ahead
            outside = max(period.since - reading, reading - until, 0.0)
            doubt = outside + _AGE_COUNTS * max(self.time - reading, 0.0)
            if doubt < least:
                best, least = reading, doubt
            until = period.since
        return min(best, self.time)


class Heard:
    """Time of the newest message, in steady time.

    Args:
        clock: stepped before each `steady`.
    """

    def __init__(self, clock: SteadyClock) -> None:
        self._clock = clock
        self._raw: float | None = None
        self._at = -math.inf

    def steady(self, raw: float) -> float:
        """Stamp of the newest message in steady time [s]; call it once per step. Infinite stamps stay as they are."""
        if not math.isfinite(raw):
            return raw
        if raw == self._raw:
            if self._clock.passed > _PAUSE:
                self._at += self._clock.passed
            return self._at
        age = max(self._clock.now - raw, 0.0)
        self._at = self._clock.time - (age if self._raw is None else min(age, _LATE))
        self._raw = raw
        return self._at


class SteadyInputs:
    """Converts a step's inputs to steady time.

    Attributes:
        clock: stepped by `step`.
    """

    def __init__(self) -> None:
        self.clock = SteadyClock()
        self._detector, self._camera, self._camera_changed = (Heard(self.clock) for _ in range(3))
        self._battery = Heard(self.clock)
        self._scan: tuple[ScanView, ScanView] | None = None  # original, and in steady time

    def step(self, now: float, inputs: Inputs) -> Inputs:
        """Advance to `now` [s]; returns the inputs with every stamp in steady time."""
        self.clock.step(now)
        if self.clock.jump:
            direction = "back" if self.clock.jump < 0.0 else "forward"
            log.warning("time went %s by %.1f s", direction, abs(self.clock.jump))
        return dataclasses.replace(
            inputs,
            detector_at=self._detector.steady(inputs.detector_at),
            camera_at=self._camera.steady(inputs.camera_at),
            camera_changed_at=self._camera_changed.steady(inputs.camera_changed_at),
            frames=tuple(self._steady_frame(frame) for frame in inputs.frames),
            battery=self._steady_battery(inputs.battery),
            scan=self._steady_scan(inputs.scan),
        )

    def _steady_battery(self, battery: Battery | None) -> Battery | None:
        return None if battery is None else dataclasses.replace(battery, at=self._battery.steady(battery.at))

    def _steady_scan(self, view: ScanView | None) -> ScanView | None:
        if view is None:
            return None
        if self._scan is None or self._scan[0] is not view:
            scan = dataclasses.replace(view.scan, stamp=self.clock.steady(view.scan.stamp))
            self._scan = view, dataclasses.replace(view, scan=scan)
        return self._scan[1]

    def _steady_frame(self, frame: Frame) -> Frame:
        if frame.stamp is None:
            return dataclasses.replace(frame, picture=self.clock.now)
        return dataclasses.replace(frame, stamp=self.clock.steady(frame.stamp), picture=frame.stamp)
