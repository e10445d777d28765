"""The identity of a network: the sum of its files."""

from __future__ import annotations

import hashlib
from pathlib import Path

from rosbot_patrol.errors import DetectorError


def network_sum(cfg: Path, weights: Path) -> str:
    """sha256 of a network's cfg and weights, one after the other; raises DetectorError if one cannot be read."""
    found = hashlib.sha256()
    for path in (cfg, weights):
        try:
            found.update(path.read_bytes())
        except OSError as err:
            raise DetectorError(f"the network file {path} cannot be read: {err.strerror}") from err
    return found.hexdigest()
