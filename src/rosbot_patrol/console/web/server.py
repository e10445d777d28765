"""The web server: this machine only until an owner has a password, then the address that was asked for, too."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from rosbot_patrol.console.web.connections import MOST, LimitedConnection
from rosbot_patrol.errors import AccessError
from rosbot_patrol.params import param

log = logging.getLogger(__name__)

LOCAL = "127.0.0.1"
_TRIED = 10  # ports from the wanted one on
_WATCH = 0.5  # [s] between two looks whether somebody has a password now


@dataclass(frozen=True, kw_only=True)
class ServerParams:
    """Parameters of the console's web server."""

    address: str = param(LOCAL, doc="address to listen on once an owner has a password; 0.0.0.0: all of this machine's")
    port: int = param(8420, lo=1, hi=65535, doc="TCP port; if it is taken, one of the next nine")
    certificate: str = param("", doc="PEM file of a TLS certificate; empty: http")
    key: str = param("", doc="PEM file of the certificate's key")


class _Server(uvicorn.Server):
    """A server that leaves the process's signals alone."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


class WebServer:
    """Serves an application until `end`.

    Args:
        params: where.
        is_open: whether nobody has a password yet.

    Attributes:
        url: address of the first page on this machine.

    Raises:
        AccessError: no port is free, or the certificate cannot be used.
    """

    def __init__(self, params: ServerParams, is_open: Callable[[], bool]) -> None:
        self._params, self._is_open = params, is_open
        for name, file in (("certificate", params.certificate), ("key", params.key)):
            if file and not Path(file).is_file():
                raise AccessError(f"the {name}", f"is to be in {file}, and there is no such file")
        self._local = _bind(LOCAL, params.port)
        self._port = int(self._local.getsockname()[1])
        scheme = "https" if params.certificate else "http"
        self.url = f"{scheme}://localhost:{self._port}"
        self._servers: list[_Server] = []
        self._is_over = False

    def end(self) -> None:
        """End from any thread; open pages are let go at once."""
        self._is_over = True
        for server in self._servers:
            server.should_exit = True

    def run(self, app: ASGIApp) -> None:
        """Serve until `end`."""
        asyncio.run(self._serve(app))

    async def _serve(self, app: ASGIApp) -> None:
        first = self._server(app, is_first=True)
        tasks = [asyncio.create_task(first.serve(sockets=[self._local]))]
        others = asyncio.create_task(self._open_later(app, tasks))
        await tasks[0]
        others.cancel()
        await asyncio.gather(*tasks[1:], others, return_exceptions=True)

    async def _open_later(self, app: ASGIApp, tasks: list[asyncio.Task[None]]) -> None:
        """Listen on the address that was asked for, as soon as that is safe."""
        if self._params.address in (LOCAL, "localhost"):
            return
        while self._is_open() and not self._is_over:
            await asyncio.sleep(_WATCH)
        if self._is_over:
            return
        try:
            found = _listen(self._params.address, self._port)
        except OSError as err:
            log.error("the console cannot listen on %s, port %d: %s", self._params.address, self._port, err)
            return
        log.info("the console listens on %s, port %d, too", self._params.address, self._port)
        tasks.append(asyncio.create_task(self._server(app, is_first=False).serve(sockets=[found])))

    def _server(self, app: ASGIApp, *, is_first: bool) -> _Server:
        server = _Server(
            uvicorn.Config(
                app,
                lifespan="on" if is_first else "off",
                log_level="warning",
                access_log=False,
                http=LimitedConnection,
                limit_concurrency=MOST,
                timeout_graceful_shutdown=1,
                ssl_certfile=self._params.certificate or None,
                ssl_keyfile=self._params.key or None,
                server_header=False,
                ws_max_size=1 << 20,
                h11_max_incomplete_event_size=1 << 16,
            )
        )
        self._servers.append(server)
        return server


def _bind(address: str, port: int) -> socket.socket:
    for each in range(port, min(port + _TRIED, 65536)):
        try:
            found = _listen(address, each)
        except OSError as err:
            log.debug("port %d: %s", each, err)
            continue
        if each != port:
            log.warning("TCP port %d is taken: the console listens on port %d", port, each)
        return found
    raise AccessError(f"the TCP ports {port} to {port + _TRIED - 1}", "are all taken: give the console another ~port")


def _listen(address: str, port: int) -> socket.socket:
    """A listening socket; that on all addresses stands beside the one on 127.0.0.1. Raises OSError."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    found = socket.socket(family, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((address, port))
        found.listen(128)
    except OSError:
        found.close()
        raise
    return found
