"""Folder of files that the set-up makes on this machine: compiled kernels, converted networks."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """`ROSBOT_PATROL_CACHE`, by default `$XDG_CACHE_HOME/rosbot_patrol` or `~/.cache/rosbot_patrol`."""
    given = os.environ.get("ROSBOT_PATROL_CACHE", "")
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "rosbot_patrol"
