"""Where this package's own files lie, without asking ROS: in the source tree, or where catkin installed them."""

from __future__ import annotations

import os
from pathlib import Path

from rosbot_patrol.errors import ParamError

_SOURCE = Path(__file__).resolve().parents[3]


def package_file(relative: str) -> Path:
    """A file of the package, such as "config/gmapping.yaml".

    Raises:
        ParamError: it is nowhere; names the folders that were tried.
    """
    spaces = filter(None, os.environ.get("CMAKE_PREFIX_PATH", "").split(":"))
    folders = [_SOURCE, *(Path(space) / "share" / "rosbot_patrol" for space in spaces)]
    for folder in folders:
        if (folder / relative).exists():
            return folder / relative
    tried = ", ".join(map(str, folders))
    raise ParamError(relative, f"is in none of {tried}: source the workspace (. scripts/env)")
