"""Folders of ROS packages and Gazebo models by name, for the meshes of a URDF and the models of a world."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import rospkg

from rosbot_patrol.simulation.urdf import FindPackage


def model_folders(more: Iterable[str] = ()) -> list[str]:
    """Where Gazebo looks for model://: folders given here, then GAZEBO_MODEL_PATH, then its own in the home folder."""
    folders = [*more, *filter(None, os.environ.get("GAZEBO_MODEL_PATH", "").split(":"))]
    return [*folders, os.path.expanduser("~/.gazebo/models")]


def package_finder(folders: Sequence[str] = ()) -> FindPackage:
    """Looks a name up in folders, then where Gazebo looks, then among the packages of ROS_PACKAGE_PATH."""
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
