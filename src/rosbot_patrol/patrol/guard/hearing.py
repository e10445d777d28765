"""Does the patrol hear the motion sensors? It compares how many messages it and the sensor watch have received.

Both listen to one topic. Somebody in the network can cut the patrol's link alone (any program may call a node's
publisherUpdate), and the patrol would take the quiet for peace.
"""

from __future__ import annotations

import math

from rosbot_patrol.patrol.records.commands import OwnerMessage

KIND = "the patrol's ear"
_LEAST = 6  # messages that the watch has heard and the patrol has not, before that means anything
_CALM = 600.0  # time of hearing well after which the owner hears that it is over [s]


class Hearing:
    """Comparison of two counts; times are of any monotonic clock [s].

    Args:
        deaf_after: time in which the watch hears messages and the patrol none [s].
    """

    def __init__(self, deaf_after: float = 8.0) -> None:
        self._deaf_after = deaf_after
        self._since = math.inf  # when the watch first reported messages that the patrol lacks
        self._missed = 0
        self._total: int | None = None
        self._deaf_at = -math.inf
        self._is_told = False
        self.is_deaf = False

    def heard(self) -> None:
        """The patrol has received a message of a sensor."""
        self._since, self._missed, self.is_deaf = math.inf, 0, False

    def told(self, total: int, now: float) -> bool:
        """Compare with the number of messages that the watch has heard so far; returns whether to listen anew.

        The number falls when the watch starts again; then nothing follows from it.
        """
        new = total - self._total if self._total is not None else 0
        self._total = total
        if new < 0:
            self._since, self._missed = math.inf, 0
        if new <= 0:
            return False
        self._missed += new
        self._since = min(self._since, now)
        if self._missed < _LEAST or now - self._since < self._deaf_after:
            return False
        self._since, self._missed = math.inf, 0  # the new link gets its time, too
        self.is_deaf, self._deaf_at = True, now
        return True

    def step(self, now: float) -> tuple[OwnerMessage, ...]:
        """Messages to the owner that are due: when it is deaf, and after ten minutes of hearing well."""
        if self.is_deaf and not self._is_told:
            self._is_told = True
            text = (
                "the patrol did not hear the motion sensors that sensor_watch hears: its link was cut. It listens anew."
                " If this comes back, somebody in your network cuts it: scripts/secure closes the network"
            )
            return (OwnerMessage(kind=KIND, text=text),)
        if self._is_told and not self.is_deaf and now - self._deaf_at >= _CALM:
            self._is_told = False
            return (OwnerMessage(kind=KIND, text="the patrol hears the motion sensors as before", is_over=True),)
        return ()
