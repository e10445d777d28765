"""Recording of the bytes that devices send, to store and replay them."""

from __future__ import annotations

from typing import Protocol

from rosbot_patrol.rosserial.server.client import Client


class Tap(Protocol):
    """Observer of connections, called on the server's thread; it must not block."""

    def opened(self, client: Client) -> None:
        """A connection began."""

    def data(self, client: Client, data: bytes) -> None:
        """Bytes arrived."""

    def closed(self, client: Client) -> None:
        """A connection ended."""
