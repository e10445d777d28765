"""A mark of this machine's network: if it changes, a channel that was down is worth a try."""

from __future__ import annotations

import hashlib
from pathlib import Path

_SOURCES = ("/proc/net/route", "/proc/net/ipv6_route", "/etc/resolv.conf")


def network_mark() -> str:
    """A mark of routes and name servers; another one means that something changed. Linux only, else always the same."""
    digest = hashlib.sha256()
    for source in _SOURCES:
        try:
            lines = Path(source).read_bytes().splitlines()
        except OSError:
            continue
        for line in lines:  # use counts, which change all the time, stand in columns of their own
            columns = line.split()
            digest.update(b" ".join(columns[:5] if "ipv6" in source else columns[:4] + columns[6:8]))
    return digest.hexdigest()
