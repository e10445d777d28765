"""Folders of ROS packages and Gazebo models by name, for meshes of a URDF and models of a world."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import rospkg

from rosbot_patrol.simulation.robot.urdf import FindPackage


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
