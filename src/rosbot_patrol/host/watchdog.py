"""Messages to systemd (sd_notify(3)): the service is ready, its watchdog is fed, and one line of state."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping


class Systemd:
    """The service manager of this process, if there is one.

    Args:
        environ: environment of the process; NOTIFY_SOCKET names the manager's socket.

    Attributes:
        is_there: whether systemd listens; else nothing is sent.
    """

    def __init__(self, environ: Mapping[str, str] = os.environ) -> None:
        self._address = environ.get("NOTIFY_SOCKET", "")
        self.is_there = bool(self._address)
        self._is_ready = False
        self._said = ""

    def say(self, status: str) -> None:
        """Set the line that `systemctl status` shows."""
        if status != self._said:
            self._said = status
            self._send(f"STATUS={status}")

    def feed(self) -> None:
        """All is at work: the service is ready, and its watchdog waits for the next time."""
        self._send("WATCHDOG=1" if self._is_ready else "READY=1\nWATCHDOG=1")
        self._is_ready = True

    def _send(self, text: str) -> None:
        if not self.is_there:
            return
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
            link.setblocking(False)
            try:
                link.sendto(text.encode(), address)
            except OSError:
                return  # the manager is busy, or has gone: the next message follows within a second
