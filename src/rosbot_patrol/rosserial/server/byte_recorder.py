"""Listening to what devices send, byte for byte, so that it can be recorded and replayed."""

from __future__ import annotations

from typing import Protocol

from rosbot_patrol.rosserial.server.client import Client


class Tap(Protocol):
    """Told of each connection by the server's thread; it must not block."""

    def opened(self, client: Client) -> None:
        """A connection began."""

    def data(self, client: Client, data: bytes) -> None:
        """Bytes came."""

    def closed(self, client: Client) -> None:
        """It ended."""
