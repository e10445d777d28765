"""What the packages install is there in a fresh clone: a folder that is only on somebody's disk breaks `install`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = sorted(file.parent for file in (ROOT / "drop_in").glob("*/CMakeLists.txt"))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.name)
def test_installed_folders_hold_files(package: Path) -> None:
    rules = re.findall(r"install\(DIRECTORY ([^$)]*?) DESTINATION", (package / "CMakeLists.txt").read_text("utf-8"))
    for folder in " ".join(rules).split():
        assert any((package / folder).rglob("*.*")), f"{package.name} installs '{folder}', which holds no file"


UPSTREAMS = {  # CATKIN_DEPENDS of upstream's packages
    "amcl": "diagnostic_updater dynamic_reconfigure geometry_msgs nav_msgs rosbag roscpp sensor_msgs std_srvs tf2 "
    "tf2_msgs tf2_ros",
    "darknet_ros": "actionlib cv_bridge darknet_ros_msgs image_transport nodelet roscpp rospy std_msgs",
    "darknet_ros_msgs": "actionlib_msgs geometry_msgs message_runtime sensor_msgs std_msgs",
    "gazebo_ros": "dynamic_reconfigure gazebo_msgs geometry_msgs roscpp rosgraph_msgs roslib std_msgs std_srvs tf",
    "map_server": "nav_msgs roscpp tf2",
    "move_base": "dynamic_reconfigure geometry_msgs move_base_msgs nav_msgs roscpp",
    "rosbot_ekf": "message_runtime roscpp rospy",
    "rosserial_msgs": "message_runtime",
}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.name)
def test_drop_ins_export_what_upstreams_packages_export(package: Path) -> None:
    """As far as it is installed: `patrol_installed` leaves out what is not. The others export nothing upstream."""
    text = (package / "CMakeLists.txt").read_text("utf-8")
    (exported,) = re.findall(r"catkin_package\(([^)]*)\)", text)
    if found := re.findall(r"patrol_installed\(exports ([^)]*)\)", text):
        exported = exported.replace("${exports}", found[0])
    names = set(exported.split())
    assert set(UPSTREAMS.get(package.name, "").split()) <= names
    xml = (package / "package.xml").read_text("utf-8")
    for name in names - {"CATKIN_DEPENDS", "message_runtime"}:
        assert f"<depend>{name}</depend>" in xml, f"catkin_package() refuses {name}, which package.xml does not list"
