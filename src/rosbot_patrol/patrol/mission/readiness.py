"""Readiness of the patrol, and what it waits for."""

from __future__ import annotations

from rosbot_patrol.patrol.records.activity import ON_GUARD
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.search.look import LookParams


class Readiness:
    """Stays ready once it is: a later call is taken at once, and its drive waits for what is missing.

    Attributes:
        is_ready: the patrol can start.
        at_rest: text while nothing happens.
    """

    def __init__(self, look: LookParams) -> None:
        self._look = look
        self._woke: float | None = None
        self._is_silent = False
        self.is_ready = False
        self.at_rest = ON_GUARD

    def step(self, now: float, inputs: Inputs) -> bool:
        """Check the inputs; `now` and the stamps of `inputs` in steady time [s]."""
        self._woke = now if self._woke is None else self._woke
        self._is_silent = now - inputs.detector_at > self._look.detector_timeout
        if not self.is_ready:
            lacks = ["move_base"] * (not inputs.link.is_up)
            lacks += ["the robot's pose in the map"] * (inputs.pose is None)
            lacks += ["its heading in odom"] * (inputs.yaw is None)
            lacks += ["the detector"] * (self._is_silent and now - self._woke < self._look.detector_wait)
            self.is_ready = not lacks
            self.at_rest = "waiting for " + " and ".join(lacks) if lacks else ON_GUARD
        return self.is_ready

    @property
    def text(self) -> str:
        """Text while nothing happens."""
        return f"{self.at_rest}; the detector is silent" if self.is_ready and self._is_silent else self.at_rest
