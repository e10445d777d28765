"""Free TCP ports for masters and bridges, in benchmarks and tests."""

from __future__ import annotations

import contextlib
import random
import socket

FIRST, END = 20000, 32768  # Linux assigns ports from END on to connections


def free_port() -> int:
    """A free port that no connection gets before it is listened on."""
    while True:
        port = random.SystemRandom().randrange(FIRST, END)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("", port))
            return port
