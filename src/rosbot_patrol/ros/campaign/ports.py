"""Free TCP ports for masters and bridges, in benchmarks and tests."""

from __future__ import annotations

import contextlib
import random
import socket

BRIDGES = 3  # of the motion sensors of one house, on consecutive ports
FIRST, END = 20000, 32768  # Linux assigns ports from END on to connections


def free_port(count: int = 1) -> int:
    """Find consecutive free ports that Linux assigns to no connection before the server listens; returns the first."""
    while True:
        first = random.SystemRandom().randrange(FIRST, END - count)
        with contextlib.ExitStack() as probes, contextlib.suppress(OSError):
            for port in range(first, first + count):
                probes.enter_context(socket.socket()).bind(("", port))
            return first
