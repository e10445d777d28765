"""Who is let in: how many connections there may be, in all and of one address, and who leaves for a newcomer.

A stranger is a connection that has neither proved itself nor announced a topic that it may have. Strangers never keep a
sensor out: the oldest of them leaves for a newcomer, first of the newcomer's own address.
"""

from __future__ import annotations

from rosbot_patrol.rosserial.client import Client


class _Crowd:
    """The connections of one address; strangers in the order in which they came."""

    def __init__(self) -> None:
        self.count = 0
        self.strangers: dict[Client, None] = {}


class Door:
    """Keeps count.

    Args:
        max_clients: on all ports together.
        max_per_address: of one address, 0 for no limit of its own.
        max_strangers: of one address, at least 1.
    """

    def __init__(self, *, max_clients: int = 600, max_per_address: int = 0, max_strangers: int = 16) -> None:
        self._max_clients = max_clients
        self._max_per_address = max_per_address
        self._max_strangers = max_strangers
        self._count = 0
        self._strangers: dict[Client, None] = {}
        self._crowds: dict[str, _Crowd] = {}

    def ask(self, address: str) -> tuple[str | None, Client | None]:
        """Why no further connection of an address is taken (None where it is), and the stranger that leaves for it."""
        crowd = self._crowds.get(address)
        own = next(iter(crowd.strangers), None) if crowd is not None else None
        if crowd is not None and len(crowd.strangers) >= self._max_strangers:
            return None, own
        if crowd is not None and 0 < self._max_per_address <= crowd.count:
            return (None, own) if own is not None else (f"{crowd.count} clients of its address are connected", None)
        if self._count < self._max_clients:
            return None, None
        stranger = own or next(iter(self._strangers), None)
        return (None, stranger) if stranger is not None else (f"{self._count} clients are connected", None)

    def enter(self, client: Client) -> None:
        """A connection has been taken; it is a stranger."""
        crowd = self._crowds.setdefault(client.address, _Crowd())
        crowd.count += 1
        crowd.strangers[client] = None
        self._strangers[client] = None
        self._count += 1

    def settle(self, client: Client) -> None:
        """It is no stranger any more."""
        self._strangers.pop(client, None)
        self._crowds[client.address].strangers.pop(client, None)

    def leave(self, client: Client) -> None:
        """Its connection has ended."""
        crowd = self._crowds[client.address]
        crowd.count -= 1
        self._count -= 1
        self.settle(client)
        if not crowd.count:
            del self._crowds[client.address]
