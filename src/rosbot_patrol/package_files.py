"""Paths of this package's and the drop-ins' files, without ROS: in the source tree, or where catkin installed them.

move_base's parameters as the launch files load them from the files of a profile.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
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
    return _first([folder / relative for folder in (_SOURCE, *_installed("rosbot_patrol"))], relative)


def package_folder(drop_in: str) -> Path:
    """Path of a drop-in package, such as "darknet_ros".

    Raises:
        ParamError: it is nowhere; names the folders that were tried.
    """
    return _first([_SOURCE / "drop_in" / drop_in, *_installed(drop_in)], drop_in)


def _installed(package: str) -> list[Path]:
    spaces = filter(None, os.environ.get("CMAKE_PREFIX_PATH", "").split(":"))
    return [Path(space) / "share" / package for space in spaces]


def _first(paths: Sequence[Path], name: str) -> Path:
    for path in paths:
        if path.exists():
            return path
    tried = ", ".join(str(path).removesuffix(f"/{name}") for path in paths)
    raise ParamError(name, f"is in none of {tried}: source the workspace (. scripts/env)")


def read_move_base(folder: Path) -> dict[str, Any]:
    """Read move_base's private namespace from a profile's yaml files, such as `config/tuned`; raises ParamError."""

    def read(name: str, keys: str) -> dict[str, Any]:
        return read_mapping(folder / name, keys=keys)

    tree = {**read("move_base.yaml", "of move_base"), **read("trajectory_planner.yaml", "TrajectoryPlannerROS")}
    common = read("costmap_common_params.yaml", "of both costmaps")
    for which in ("global_costmap", "local_costmap"):
        tree[which] = {**common, **read(f"{which}_params.yaml", which)[which]}
    return tree
