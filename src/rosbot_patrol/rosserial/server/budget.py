"""Rate limit of a client, or of all clients of one address."""

from __future__ import annotations


class Budget:
    """Token bucket that fills with `rate` per second; it may be overdrawn, and then the client waits.

    Args:
        rate: units a second, 0 for no limit.
        now: time at which it is full [s].
        seconds: capacity, in seconds of `rate`.
    """

    __slots__ = ("_at", "_credit", "_most", "_rate")

    def __init__(self, rate: float, now: float, seconds: float = 1.0) -> None:
        self._rate = rate
        self._most = self._credit = rate * seconds
        self._at = now

    @property
    def debt(self) -> float:
        """Amount used at the last call, 0 without a limit."""
        return self._most - self._credit

    def spend(self, cost: float, now: float) -> float:
        """Take `cost` units (0: only ask); returns how long nothing more may be taken [s]."""
        rate = self._rate
        if rate <= 0.0:
            return 0.0
        credit = self._credit + (now - self._at) * rate
        self._credit = credit = min(credit, self._most) - cost
        self._at = now
        return 0.0 if credit >= 0.0 else -credit / rate
