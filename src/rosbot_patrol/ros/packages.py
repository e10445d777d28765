"""Folders of ROS packages and Gazebo models by name, for the meshes of a URDF."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import rospkg

from rosbot_patrol.simulation.urdf import FindPackage


def package_finder(folders: Sequence[str] = ()) -> FindPackage:
    """Looks a name up in folders, then in GAZEBO_MODEL_PATH, then among the packages of ROS_PACKAGE_PATH."""
    packages = rospkg.RosPack()
    places = [*folders, *filter(None, os.environ.get("GAZEBO_MODEL_PATH", "").split(":"))]

    def find(name: str) -> Path | None:
        for place in map(Path, places):
            if (place / name).is_dir():
                return place / name
        try:
            return Path(packages.get_path(name))
        except rospkg.ResourceNotFound:
            return None

    return find
