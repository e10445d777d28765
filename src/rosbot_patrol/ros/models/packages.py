"""Folders of ROS packages and Gazebo models by name, for meshes of a URDF and models of a world."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import rospkg

from rosbot_patrol.simulation.robot.urdf import FindPackage
from rosbot_patrol.simulation.sdf.world import World, load_world


def model_folders(more: Iterable[str] = ()) -> list[str]:
    """Folders that Gazebo searches for models: those given here, GAZEBO_MODEL_PATH, its own, its resources."""
    given, resources = (os.environ.get(f"GAZEBO_{what}_PATH", "").split(":") for what in ("MODEL", "RESOURCE"))
    return [*more, *filter(None, given), os.path.expanduser("~/.gazebo/models"), *filter(None, resources)]


def package_finder(folders: Sequence[str] = ()) -> FindPackage:
    """Make a function that looks a name up in folders, then in Gazebo's, then among ROS_PACKAGE_PATH's packages."""
    packages = rospkg.RosPack()
    places = model_folders(folders)

    def find(name: str) -> Path | None:
        for place in map(Path, places):
            if (place / name).is_dir():
                return place / name
        try:
            return Path(packages.get_path(name))
        except rospkg.ResourceNotFound:
            return None

    return find


@functools.lru_cache(maxsize=4)  # a campaign asks several times; its warnings need not be repeated
def read_world(path: Path) -> World:
    """Read a world with Gazebo's folders of models and ROS's packages. Raises WorldError."""
    return load_world(path, model_folders(), package_finder())
