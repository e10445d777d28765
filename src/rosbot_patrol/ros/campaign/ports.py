"""Free TCP ports for masters and bridges, in benchmarks and tests."""

from __future__ import annotations

import contextlib
import random
import socket

FIRST, END = 20000, 32768  # Linux assigns ports from END on to connections


def free_port() -> int:
    """Find a free port that Linux does not assign to a connection before the server listens."""
    while True:
        port = random.SystemRandom().randrange(FIRST, END)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("", port))
            return port
