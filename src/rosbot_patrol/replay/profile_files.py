"""move_base's parameters as the launch files load them from the files of a profile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rosbot_patrol.yaml_files import read_mapping


def read_move_base(folder: Path) -> dict[str, Any]:
    """move_base's private namespace from a profile's yaml files, such as those of `config/tuned`; raises ParamError."""

    def read(name: str, keys: str) -> dict[str, Any]:
        return read_mapping(folder / name, keys=keys)

    tree = {**read("move_base.yaml", "of move_base"), **read("trajectory_planner.yaml", "TrajectoryPlannerROS")}
    common = read("costmap_common_params.yaml", "of both costmaps")
    for which in ("global_costmap", "local_costmap"):
        tree[which] = {**common, **read(f"{which}_params.yaml", which)[which]}
    return tree
