"""Silence of a neighbour of the patrol, the sensor watch, and the messages to the owner about it."""

from __future__ import annotations

import math

from rosbot_patrol.patrol.records.commands import OwnerMessage

KIND = "the sensors' watch"


class Absence:
    """One neighbour. Times are of any monotonic clock [s].

    Args:
        silent_after: silence after which it counts as gone [s].
        notice_after: duration of its absence, and of its return, before the owner hears of it [s].
    """

    def __init__(self, silent_after: float, notice_after: float) -> None:
        self._silent_after, self._notice_after = silent_after, notice_after
        self._heard = -math.inf
        self._since = math.inf  # when a change not reported yet was first seen
        self._is_reported = False

    def heard(self, now: float) -> None:
        """It has said something."""
        self._heard = now

    @property
    def was_heard(self) -> bool:
        """Whether it ever said something; one that is not there from the start is not missed."""
        return self._heard > -math.inf

    def silence(self, now: float) -> float:
        """How long it has been gone [s], 0 where it is there, or never was."""
        quiet = now - self._heard
        return quiet if self.was_heard and quiet > self._silent_after else 0.0

    def step(self, now: float) -> tuple[OwnerMessage, ...]:
        """Messages to the owner that are due; call it often: gaps in our own calls are not counted as its silence."""
        is_gone = self.silence(now) > 0.0
        if is_gone == self._is_reported:
            self._since = math.inf
            return ()
        self._since = min(self._since, now)
        if now - self._since < self._notice_after:
            return ()
        self._is_reported = is_gone
        text = "the program sensor_watch has gone, or hangs: nobody tells of motion sensors that fail. See its log"
        if not is_gone:
            text = "the program sensor_watch is heard again: it tells of motion sensors that fail"
        return (OwnerMessage(kind=KIND, text=text, is_over=not is_gone),)
