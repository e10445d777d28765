"""TCP ports for masters and bridges of one's own, in benchmarks and tests."""

from __future__ import annotations

import contextlib
import random
import socket

FIRST, END = 20000, 32768  # Linux gives connections those from END on


def free_port() -> int:
    """A port that nobody has, and that no connection gets before it is listened on."""
    while True:
        port = random.SystemRandom().randrange(FIRST, END)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("", port))
            return port
