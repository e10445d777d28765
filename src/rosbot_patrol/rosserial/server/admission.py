"""Admission of connections: limits in total and per address, and which one leaves for a newcomer.

A stranger is a connection that has neither proved its identity nor announced a permitted topic. Strangers never keep a
sensor out: the oldest of them leaves for a newcomer, first one of the newcomer's own address.
"""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.counts import count_of
from rosbot_patrol.rosserial.server.budget import Budget
from rosbot_patrol.rosserial.server.client import Client

CONNECTION_COST = 4.0  # of an address's budget, in frames
BURST = 0.25  # [s] worth of an address's frames at once: other frames are not delayed by more
KEPT_ADDRESSES = 1000  # addresses without a connection with remembered budgets
MAX_PER_SENSOR = 4  # connections that have proved the same sensor


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on connections, and on the frames from one address.

    Attributes:
        clients: TCP connections on all ports together.
        per_address: of one address, 0 for no limit of its own.
        strangers: of one address, at least 1.
        rate: frames per second from one address; faster clients are read more slowly; 0: no limit.
    """

    clients: int = 600
    per_address: int = 0
    strangers: int = 100
    rate: float = 0.0


class _Crowd:
    """Connections of one address; strangers in the order of their arrival."""

    def __init__(self, rate: float, now: float) -> None:
        self.count = 0
        self.strangers: dict[Client, None] = {}
        self.budget = Budget(rate, now, BURST)


class Door:
    """Counts connections and decides on admission."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._count = 0
        self._strangers: dict[Client, None] = {}
        self._crowds: dict[str, _Crowd] = {}
        self._proven: dict[int, set[Client]] = {}

    @property
    def strangers(self) -> int:
        """Number of strangers."""
        return len(self._strangers)

    def ask(self, address: str, now: float) -> tuple[str | None, Client | None]:
        """Reason why an address gets no further connection (None if it does), and the stranger that leaves for it."""
        limits, crowd = self._limits, self._crowd(address, now)
        if crowd.budget.spend(0.0, now) > 0.0:
            return "its address connects or sends too often", None
        crowd.budget.spend(CONNECTION_COST, now)
        own = next(iter(crowd.strangers), None)
        if len(crowd.strangers) >= limits.strangers:
            return None, own
        if 0 < limits.per_address <= crowd.count:
            many = count_of(crowd.count, "client of its address is", "clients of its address are")
            return (None, own) if own is not None else (f"{many} connected", None)
        if self._count < limits.clients:
            return None, None
        stranger = own or next(iter(self._strangers), None)
        many = count_of(self._count, "client is", "clients are")
        return (None, stranger) if stranger is not None else (f"{many} connected", None)

    def enter(self, client: Client, now: float) -> None:
        """Count a new connection, as a stranger."""
        crowd = self._crowd(client.address, now)
        client.shared = crowd.budget
        crowd.count += 1
        crowd.strangers[client] = None
        self._strangers[client] = None
        self._count += 1

    def prove(self, client: Client, sensor_id: int) -> bool:
        """Count a proved connection; returns whether its sensor may have one more (limits a stolen key)."""
        clients = self._proven.setdefault(sensor_id, set())
        clients.add(client)
        self.settle(client)
        return len(clients) <= MAX_PER_SENSOR

    def settle(self, client: Client) -> None:
        """Count a connection as no stranger any more."""
        if self._strangers.pop(client, self) is None:
            self._crowds[client.address].strangers.pop(client, None)

    def leave(self, client: Client) -> None:
        """Remove an ended connection."""
        self.settle(client)
        self._crowds[client.address].count -= 1
        self._count -= 1
        sensor_id = client.session.proven_id
        if sensor_id in self._proven:
            self._proven[sensor_id].discard(client)

    def _crowd(self, address: str, now: float) -> _Crowd:
        crowd = self._crowds.get(address)
        if crowd is None:
            if len(self._crowds) >= self._limits.clients + KEPT_ADDRESSES:
                self._crowds = {each: crowd for each, crowd in self._crowds.items() if crowd.count}
            crowd = self._crowds[address] = _Crowd(self._limits.rate, now)
        return crowd
