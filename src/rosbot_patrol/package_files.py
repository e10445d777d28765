"""Paths of this package's own files, without ROS: in the source tree, or where catkin installed them.

move_base's parameters as the launch files load them from the files of a profile.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from rosbot_patrol.errors import ParamError
from rosbot_patrol.yaml_files import read_mapping

_SOURCE = Path(__file__).resolve().parents[2]


def package_file(relative: str) -> Path:
    """Path of a file of the package, such as "config/gmapping.yaml".

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


def read_move_base(folder: Path) -> dict[str, Any]:
    """Read move_base's private namespace from a profile's yaml files, such as `config/tuned`; raises ParamError."""

    def read(name: str, keys: str) -> dict[str, Any]:
        return read_mapping(folder / name, keys=keys)

    tree = {**read("move_base.yaml", "of move_base"), **read("trajectory_planner.yaml", "TrajectoryPlannerROS")}
    common = read("costmap_common_params.yaml", "of both costmaps")
    for which in ("global_costmap", "local_costmap"):
        tree[which] = {**common, **read(f"{which}_params.yaml", which)[which]}
    return tree
