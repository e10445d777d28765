"""C++ packages in an overlay that are built on our drop-ins, as on upstream's packages; needs the built workspace."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

ROOT = Path(__file__).parents[2]
DEVEL = ROOT / ".ws" / "devel"

PACKAGE = """<package format="2"><name>watcher</name><version>1.0.0</version><description>x</description>
<maintainer email="a@b.example">x</maintainer><license>BSD</license><buildtool_depend>catkin</buildtool_depend>
{depends}</package>"""
CMAKE = """cmake_minimum_required(VERSION 3.19)
project(watcher)
find_package(catkin REQUIRED COMPONENTS {components})
catkin_package(CATKIN_DEPENDS {components})
include_directories(${{catkin_INCLUDE_DIRS}})
add_library(watcher OBJECT watcher.cpp)
"""


def configure(source: Path, build: Path) -> None:
    command = [
        "cmake",
        "-S",
        source,
        "-B",
        build,
        f"-DCMAKE_PREFIX_PATH={DEVEL};/usr",
        "-DPYTHON_EXECUTABLE=/usr/bin/python3",
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def overlay(folder: Path, components: list[str], source: str) -> Path:
    """A package that is built on others."""
    folder.mkdir()
    depends = "".join(f"<depend>{name}</depend>" for name in components)
    (folder / "package.xml").write_text(PACKAGE.format(depends=depends))
    (folder / "CMakeLists.txt").write_text(CMAKE.format(components=" ".join(components)))
    (folder / "watcher.cpp").write_text(source)
    return folder


def build(folder: Path) -> None:
    done = subprocess.run(["cmake", "--build", folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_package_on_darknet_ros_and_move_base_compiles(tmp_path: Path) -> None:
    """It names no message package, as with upstream's."""
    headers = ("ros/ros.h", "darknet_ros_msgs/BoundingBoxes.h", "darknet_ros_msgs/CheckForObjectsAction.h")
    headers += ("geometry_msgs/PoseStamped.h", "move_base_msgs/MoveBaseAction.h", "nav_msgs/GetPlan.h")
    headers += ("rosbot_ekf/Configuration.h", "rosserial_msgs/Log.h")
    source = "".join(f"#include <{header}>\n" for header in headers)
    source += "int boxes(const darknet_ros_msgs::BoundingBoxes& seen) { return seen.bounding_boxes.size(); }\n"
    components = ["darknet_ros", "move_base", "amcl", "map_server", "rosbot_ekf", "rosserial_msgs"]
    configure(overlay(tmp_path / "watcher", components, source), tmp_path / "build")
    build(tmp_path / "build")
