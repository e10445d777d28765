"""Limits on connections, so that a stranger who opens many or says little keeps nobody else out.

uvicorn waits for the first request for ever, and counts connections of all peers together. Here a request has to be
complete within some seconds, and a peer has a share of the connections. A proxy on this machine speaks for many people,
so 127.0.0.1 has a larger one.
"""

from __future__ import annotations

import asyncio
import logging

from uvicorn.protocols.http.h11_impl import H11Protocol

log = logging.getLogger(__name__)

MOST = 300  # connections in all
_OF_A_PEER, _OF_THE_PROXY = 40, 250
_REQUEST_WITHIN = 10.0  # [s] for the head of a request
_PROXY = ("127.0.0.1", "::1")


class LimitedConnection(H11Protocol):
    """HTTP/1.1 with these limits."""

    _timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or close it where its peer has too many."""
        super().connection_made(transport)
        peer = self.client[0] if self.client else ""
        clients = (getattr(each, "client", None) for each in self.connections)
        count = sum(1 for client in clients if client and client[0] == peer)
        if count > (_OF_THE_PROXY if peer in _PROXY else _OF_A_PEER):
            log.debug("%s has %d connections: one more is closed", peer, count - 1)
            transport.abort()
            return
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget a connection."""
        self._waited()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request."""
        if self._timer is None and self._is_idle:
            self._wait()
        super().data_received(data)
        if not self._is_idle:
            self._waited()

    def handle_websocket_upgrade(self, event: object) -> None:
        """Hand the connection over to the protocol of websockets."""
        self._waited()
        super().handle_websocket_upgrade(event)  # type: ignore[arg-type]

    @property
    def _is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def _wait(self) -> None:
        self._timer = self.loop.call_later(_REQUEST_WITHIN, self._give_up)

    def _waited(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _give_up(self) -> None:
        self._timer = None
        if not self.transport.is_closing():
            self.transport.abort()
