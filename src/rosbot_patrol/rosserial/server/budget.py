"""How much a client, or all clients of one address, may ask for in a second."""

from __future__ import annotations


class Budget:
    """Fills with `rate` a second; may be overdrawn, and then one has to wait.

    Args:
        rate: units a second, 0 for no limit.
        now: time at which it is full [s].
        seconds: how many seconds' worth it holds.
    """

    __slots__ = ("_at", "_credit", "_most", "_rate")

    def __init__(self, rate: float, now: float, seconds: float = 1.0) -> None:
        self._rate = rate
        self._most = self._credit = rate * seconds
        self._at = now

    @property
    def debt(self) -> float:
        """How much of it was used up when it was last asked, 0 without a limit."""
        return self._most - self._credit

    def spend(self, cost: float, now: float) -> float:
        """Take `cost` units (0 to only ask); return how long nothing more may be taken [s]."""
        rate = self._rate
        if rate <= 0.0:
            return 0.0
        credit = self._credit + (now - self._at) * rate
        self._credit = credit = min(credit, self._most) - cost
        self._at = now
        return 0.0 if credit >= 0.0 else -credit / rate
